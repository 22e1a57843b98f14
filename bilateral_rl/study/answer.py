"""The answer to the question which reading of the paper gives its results: claims by readings, and what each turns on.

A cell shows a claim's verdict under one reading, with the effect of the component that decides it
(:attr:`~bilateral_rl.claims.claim.Claim.deciding`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import pandas as pd

from bilateral_rl.claims import Claim, Judgement, Verdict


@dataclass(frozen=True)
class Turn:
    """A claim's verdict under a reading and under one that deviates from it, or under two anchors."""

    source: Judgement
    target: Judgement
    before: Verdict
    """The verdict under ``source``."""
    after: Verdict
    """The verdict under ``target``."""

    @property
    def choice(self) -> str:
        """What ``target`` chooses otherwise, in words."""
        return chosen_otherwise(self.source, self.target)


class Answer:
    """What all readings say together.

    Args:
        judgements: what each reading makes of the claims, in the order in which they are shown; at least one.
    """

    def __init__(self, judgements: Sequence[Judgement]) -> None:
        self.judgements = tuple(judgements)
        self._by_name = {judgement.reading: judgement for judgement in judgements}
        self._claims = {judgement.reading: {c.number: c for c in judgement.claims} for judgement in judgements}

    @property
    def numbers(self) -> list[str]:
        """The claims, "C1" to "C14"."""
        return [claim.number for claim in self.judgements[0].claims]

    @property
    def anchors(self) -> list[Judgement]:
        """The readings that deviate from no other one that was judged."""
        return [judgement for judgement in self.judgements if judgement.anchor not in self._by_name]

    def source(self, judgement: Judgement) -> Judgement | None:
        """Return the reading from which another deviates; None if that was not judged, or there is none."""
        return self._by_name.get(judgement.anchor or "")

    def groups(self) -> list[list[Judgement]]:
        """Return each anchor followed by the readings that deviate from it; every reading stands in one place."""
        groups = {anchor.reading: [anchor] for anchor in self.anchors}
        for judgement in self.judgements:
            root = judgement
            while (source := self.source(root)) is not None:
                root = source
            if root is not judgement:
                groups[root.reading].append(judgement)
        return list(groups.values())

    def claim(self, judgement: Judgement, number: str) -> Claim:
        """Return a claim as a reading judges it."""
        return self._claims[judgement.reading][number]

    def count(self, number: str) -> Counter[Verdict]:
        """Count the readings of each verdict on a claim."""
        return Counter(self.claim(judgement, number).verdict for judgement in self.judgements)

    @property
    def in_all(self) -> list[str]:
        """The claims that are supported under every reading."""
        return [number for number in self.numbers if self.count(number)["supported"] == len(self.judgements)]

    @property
    def in_none(self) -> list[str]:
        """The claims that are supported under no reading."""
        return [number for number in self.numbers if not self.count(number)["supported"]]

    @property
    def turning(self) -> list[str]:
        """The claims that are supported under some readings and not under others."""
        return [number for number in self.numbers if number not in (*self.in_all, *self.in_none)]

    def turns(self, number: str) -> list[Turn]:
        """Return the choices that change the verdict on a claim: anchor against anchor, then each deviation."""
        return [turn for turn in self._compared(number) if turn.before != turn.after]

    def distinct(self, number: str) -> list[Judgement]:
        """Return the readings that give a claim numbers of its own; of those that give the same, only the first.

        They stand in the order of :meth:`groups`.
        """
        first: dict[object, Judgement] = {}
        for judgement in self._in_groups():
            components = self.claim(judgement, number).components
            first.setdefault(tuple((c.text, c.verdict, repr(c.estimate), repr(c.p)) for c in components), judgement)
        return list(first.values())

    def table(self) -> pd.DataFrame:
        """Return a row a reading and claim: the verdict, and the component that decides it with its numbers."""
        return pd.DataFrame(
            {
                "reading": judgement.reading,
                "anchor": judgement.anchor or "",
                "claim": claim.number,
                "verdict": claim.verdict,
                "components": len(claim.components),
                "components_supported": n_supported(claim),
                "deciding_component": claim.deciding.text,
                "effect": claim.deciding.effect.value,
                "effect_low": claim.deciding.effect.low,
                "effect_high": claim.deciding.effect.high,
                "quantity": claim.deciding.quantity,
                "unit": claim.deciding.unit,
                "estimate": claim.deciding.estimate.value,
                "low": claim.deciding.estimate.low,
                "high": claim.deciding.estimate.high,
                "n": claim.deciding.estimate.n,
                "test": claim.deciding.test,
                "p": claim.deciding.p,
            }
            for judgement in self.judgements
            for claim in judgement.claims
        )

    def _in_groups(self) -> list[Judgement]:
        return [judgement for group in self.groups() for judgement in group]

    def _compared(self, number: str) -> Iterator[Turn]:
        first, *others = self.anchors
        pairs = [(first, other) for other in others]
        pairs += [(source, judgement) for judgement in self._in_groups() if (source := self.source(judgement))]
        for source, target in pairs:
            yield Turn(source, target, self.claim(source, number).verdict, self.claim(target, number).verdict)


def tally(judgement: Judgement) -> Counter[Verdict]:
    """Count the claims of each verdict under a reading."""
    return Counter(claim.verdict for claim in judgement.claims)


def n_supported(claim: Claim) -> int:
    """Count the components of a claim that are supported."""
    return sum(component.verdict == "supported" for component in claim.components)


def chosen_otherwise(source: Judgement, target: Judgement) -> str:
    """Return what one reading chooses otherwise than another, in words; its name if nothing."""
    others = source.choices
    return ", ".join(f"{n}: {v}" for n, v in target.choices.items() if others.get(n) != v) or target.reading
