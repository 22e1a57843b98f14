"""How many seeds a confirmation needs: each component of a claim, and so each claim, under each reading."""

from __future__ import annotations

import math
from functools import lru_cache

import pandas as pd

from bilateral_rl.analysis.power import MOST_SEEDS, POWER, SMALLEST_EFFECT_OF_INTEREST, SPREAD_CONFIDENCE, Design
from bilateral_rl.analysis.statistics import ALPHA
from bilateral_rl.claims import Claim, Component, Judgement
from bilateral_rl.study.answer import Answer
from bilateral_rl.study.report_table import ReportTable

NOTE = (
    f"Fixed before any seed of a confirmation was run: a difference of {100 * SMALLEST_EFFECT_OF_INTEREST:g} % of the "
    f"mean is to be found with a probability of {100 * POWER:g} % at a two-sided α of {100 * ALPHA:g} %, by the test "
    "that decides the component and in the family of comparisons that it is in. What is to lie within a range is "
    "planned for its middle, and what is to lie beyond a bound for equality, or that much beyond it if that is nearer. "
    f"The spread over seeds is the upper {100 * SPREAD_CONFIDENCE:g} % limit of this study's, so that few seeds do not "
    "promise too much. A claim needs the largest number of its components'; one that needs more than "
    f"{MOST_SEEDS} seeds is undecidable at this cost."
)


def seeds_of_components(answer: Answer) -> pd.DataFrame:
    """Return a row a reading, claim and component: what is to be found, the spread, and the seeds that it takes.

    ``seeds`` is missing where :data:`MOST_SEEDS` are not enough, or where too few were explored to say; the column
    ``power`` tells these apart: it is the power with as many, and NaN where nobody can say.
    """
    return pd.DataFrame(
        {
            "reading": judgement.reading,
            "claim": claim.number,
            "component": component.text,
            "test": component.test or "95 % interval",
            **_columns(component.design),
        }
        for judgement in answer.judgements
        for claim in judgement.claims
        for component in claim.components
    ).astype({"comparisons": "Int64", "seeds": "Int64"})


def seeds_table(answer: Answer) -> ReportTable:
    """Say for every claim how many seeds it takes under each anchor, and which component takes them."""
    columns = [""]
    for anchor in answer.anchors:
        columns += [f"seeds under “{anchor.reading}”", f"for, under “{anchor.reading}”"]
    rows = []
    for number in answer.numbers:
        row = [number]
        for anchor in answer.anchors:
            row += _demand(answer.claim(anchor, number))
        rows.append(row)
    of_words = tuple(range(2, len(columns), 2))
    note = f"{NOTE}\n{' '.join(map(_of_anchor, answer.anchors))}"
    return ReportTable("seeds", "Seeds that the claims need", columns, rows, note, of_words)


def seeds_of(claim: Claim) -> int | None:
    """Return how many seeds a claim takes; None if :data:`MOST_SEEDS` are not enough, or nobody can say."""
    needed = [_seeds(component.design) for component in claim.components]
    return None if None in needed else max(n for n in needed if n is not None)


def demand_in_words(component: Component) -> str:
    """Say how many seeds decide a component; "" of those that are decided, or of which nobody can say."""
    if component.verdict != "undecided" or math.isnan(_power_at_most(component.design)):
        return ""
    seeds = _seeds(component.design)
    if seeds is None:
        return f"Undecidable at this cost: it takes more than {MOST_SEEDS} seeds."
    return f"It takes {seeds} seeds to decide."


def _of_anchor(anchor: Judgement) -> str:
    """Say how many seeds do for how many claims under an anchor."""
    needed = {claim.number: seeds_of(claim) for claim in anchor.claims}
    decidable = [n for n in needed.values() if n is not None]
    if not decidable:
        return f"Under “{anchor.reading}”, no claim is decidable at this cost."
    others = [number for number, n in needed.items() if n is None]
    share = (
        f"{len(decidable)} of {len(needed)} claims; not for {', '.join(others)}"
        if others
        else (f"all {len(needed)} claims")
    )
    return f"Under “{anchor.reading}”, {max(decidable)} seeds do for {share}."


def _demand(claim: Claim) -> list[str]:
    """The number of seeds of a claim, and its component that needs the most."""
    component = max(claim.components, key=_need)
    seeds, power = _seeds(component.design), _power_at_most(component.design)
    if seeds is not None:
        return [str(seeds), component.text]
    if math.isnan(power):
        return ["–", f"{component.text}: too few seeds were explored to say"]
    return [f"more than {MOST_SEEDS}", f"{component.text} ({MOST_SEEDS} seeds have a power of {100 * power:.0f} %)"]


def _need(component: Component) -> tuple[bool, int, float]:
    """A key by which components rise with the seeds that they need; first of all those of which nobody can say."""
    seeds, power = _seeds(component.design), _power_at_most(component.design)
    return math.isnan(power), MOST_SEEDS + 1 if seeds is None else seeds, -power


def _columns(design: Design | None) -> dict[str, object]:
    spreads = design.spreads if design else ()
    return {
        "kind": design.kind if design else "",
        "to_find": design.effect if design else math.nan,
        "sd_limit": math.sqrt(sum(spread.upper**2 for spread in spreads)) if spreads else math.nan,
        "comparisons": max(design.comparisons, math.comb(design.groups, 2)) if design else None,
        "seeds": _seeds(design),
        "power": _power_at_most(design),
    }


@lru_cache(maxsize=4096)  # readings share many components
def _seeds(design: Design | None) -> int | None:
    return design.seeds() if design else None


@lru_cache(maxsize=4096)
def _power_at_most(design: Design | None) -> float:
    return design.power(MOST_SEEDS) if design else math.nan
