"""A claim of the paper, its components, and what our results say about them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bilateral_rl.analysis.formats import number, p_equation
from bilateral_rl.analysis.intervals import Interval
from bilateral_rl.analysis.power import Design
from bilateral_rl.analysis.samples import join_notes
from bilateral_rl.claims.rules import Verdict, all_of

NOTHING = Interval(math.nan, math.nan, math.nan, 0)
"""The estimate where there is none."""


@dataclass(frozen=True)
class Component:
    """One statement of a claim that a single estimate or test decides."""

    text: str
    """The statement, such as "goal completion within 5 cm: uni_dl > uni_ndl"."""
    measured: str
    """The samples that are compared, mean ± standard deviation over the seeds; "" if nothing was measured."""
    quantity: str
    """Name of what is estimated, such as "mean", "difference" or "ratio"; "" if nothing was."""
    unit: str
    """Unit of the estimate, "" if it has none."""
    estimate: Interval
    """The estimate with its own 95 % interval; NaN where there is none."""
    verdict: Verdict
    test: str = ""
    """Name of the test, "" where an interval alone decides."""
    p: float = float("nan")
    """p-value, adjusted for the family of comparisons that ``test`` names; NaN where there is no test."""
    tukey_p: float = float("nan")
    """p-value of the paper's test of the same comparison, Tukey's HSD; NaN where the paper has none."""
    note: str = ""
    """What readers must know about the numbers."""
    effect: Interval = NOTHING
    """How far the estimate lies on the claim's side of the line that the statement draws, as a share of the mean
    (:mod:`bilateral_rl.claims.effects`): positive as claimed. NaN where nothing was measured."""
    design: Design | None = None
    """What the number of seeds of a confirmation follows from; None if nothing was measured."""
    relearned: tuple[str, ...] = ()
    """States that are no better than freshly initialized networks after the same protocol: what they show is what the
    protocol teaches, not what was kept."""

    @property
    def numbers(self) -> str:
        """Our numbers in words: what was measured, the estimate with its interval, and the test."""
        if not self.measured:
            return self.note
        unit = f" {self.unit}" if self.unit else ""
        value = "" if self.quantity == "mean" else f"{self.quantity} {number(self.estimate.value)}{unit}, "
        parts = [self.measured, f"{value}{_bounds(self.estimate)}"]
        if self.test:
            parts.append(f"{self.test}: {p_equation(self.p)}")
        if not math.isnan(self.tukey_p):
            parts.append(f"Tukey's HSD, as in the paper: {p_equation(self.tukey_p)}")
        return "; ".join(parts)


@dataclass(frozen=True)
class Aside:
    """Statements of a claim judged otherwise; they stand beside it and decide nothing."""

    name: str
    """How they are judged, such as "without retraining"."""
    components: tuple[Component, ...]
    """The statements."""

    @property
    def verdict(self) -> Verdict:
        """What the claim's verdict would be by these statements alone."""
        return all_of(component.verdict for component in self.components)

    @property
    def summary(self) -> str:
        """The verdict and how many statements have which, in words."""
        verdicts = [component.verdict for component in self.components]
        counts = ", ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in dict.fromkeys(verdicts))
        return f"{self.name} {self.verdict} ({counts})"


@dataclass(frozen=True)
class Claim:
    """One of the paper's claims."""

    number: str
    """"C1" to "C14"."""
    statement: str
    """The claim in words, after the paper."""
    components: tuple[Component, ...]
    """The statements that make up the claim."""
    beside: tuple[Aside, ...] = ()
    """The same statements judged otherwise, such as of networks that were not retrained. Only claims on lesions have
    some."""

    @property
    def verdict(self) -> Verdict:
        """The claim is supported if all components are, not supported if any is not, otherwise undecided."""
        return all_of(component.verdict for component in self.components)

    @property
    def unjudged(self) -> bool:
        """Whether it is undecided because a component has no results at all."""
        return self.verdict == "undecided" and any(not component.measured for component in self.components)

    @property
    def deciding(self) -> Component:
        """The weakest component: of those that have the claim's verdict, that with the least effect.

        Components of which nothing was measured come last.
        """
        deciding = [component for component in self.components if component.verdict == self.verdict]
        return min(deciding, key=lambda component: (math.isnan(component.effect.value), component.effect.value))

    @property
    def numbers(self) -> str:
        """Every component in words, a line each."""
        return "\n".join(f"{component.text}: {component.numbers}" for component in self.components)

    @property
    def tests(self) -> str:
        """The names of the tests, or "95 % interval" where intervals decide."""
        return join_notes(*(component.test or "95 % interval" for component in self.components))

    @property
    def note(self) -> str:
        """What is missing and what else readers must know, each thing once; "" if nothing."""
        return join_notes(*(component.note for component in self.components), self.further_note)

    @property
    def further_note(self) -> str:
        """What :attr:`note` says beyond the words of components that have nothing but their note."""
        relearned = ", ".join(dict.fromkeys(name for component in self.components for name in component.relearned))
        return join_notes(
            *(component.note for component in self.components if component.measured),
            f"no better than a fresh network: {relearned}" if relearned else "",
            *(aside.summary for aside in self.beside),
        )


def _bounds(interval: Interval) -> str:
    if math.isnan(interval.low):
        return "no interval"
    return f"95 % interval {number(interval.low)} to {number(interval.high)}"
