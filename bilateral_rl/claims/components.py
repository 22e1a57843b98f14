"""Builders of components: which estimate and which test decide a statement on samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import pandas as pd

from bilateral_rl.analysis.intervals import Interval, difference_interval, mean_interval, ratio_interval
from bilateral_rl.analysis.samples import Float64, align
from bilateral_rl.analysis.statistics import PairTest, holm, paired_test, welch_test
from bilateral_rl.claims.claim import Component
from bilateral_rl.claims.evidence import Evidence, Sample
from bilateral_rl.claims.margins import SMALLEST_EFFECT
from bilateral_rl.claims.rules import Verdict, is_greater, is_not_conclusively_greater, is_within

Rule = Callable[[Interval, float, float], Verdict]
_NAN = float("nan")
_NOTHING = Interval(_NAN, _NAN, _NAN, 0)


@dataclass(frozen=True)
class Contrast:
    """Two samples of one measure of which the first should be greater."""

    greater: Sample
    lesser: Sample
    paired: bool = False
    """Whether both are of the same networks, so that seeds are compared with themselves."""

    @property
    def text(self) -> str:
        """What is stated."""
        return f"{self.greater.measure.text}: {self.greater.name} > {self.lesser.name}"

    @property
    def values(self) -> tuple[Float64, Float64]:
        """Of both, seed by seed if paired."""
        if self.paired:
            return align(self.greater.values, self.lesser.values)
        return self.greater.values.to_numpy(dtype=float), self.lesser.values.to_numpy(dtype=float)

    def test(self) -> PairTest:
        """Of this contrast alone."""
        return paired_test(*self.values) if self.paired else welch_test(*self.values)


def holm_family(contrasts: Sequence[Contrast]) -> list[Component]:
    """Directions, each tested paired or by Welch's t, p-values adjusted after Holm for all of them."""
    tests = [contrast.test() for contrast in contrasts]
    adjusted = holm([test.p for test in tests])
    suffix = ", Holm" if len(tests) > 1 else ""
    return [
        _direction(contrast, float(p), f"{test.name}{suffix}")
        for contrast, test, p in zip(contrasts, tests, adjusted, strict=True)
    ]


def post_hoc(evidence: Evidence, contrasts: Sequence[Contrast], rule: Rule = is_greater) -> list[Component]:
    """Directions between intact models, p-values of Games–Howell over all models, Tukey's HSD reported beside them."""
    components = []
    for contrast in contrasts:
        pair = contrast.greater.model, contrast.lesser.model
        howell, tukey = evidence.post_hoc(contrast.greater.measure, *pair)
        components.append(_direction(contrast, howell.p, howell.name, tukey.p, rule))
    return components


def not_greater(evidence: Evidence, contrasts: Sequence[Contrast]) -> list[Component]:
    """That the first of each contrast is not conclusively greater, by :func:`post_hoc`."""
    return post_hoc(evidence, contrasts, is_not_conclusively_greater)


def mean_within(sample: Sample, low: float, high: float = float("inf")) -> Component:
    """That a mean lies from ``low`` to ``high``, in the unit of its metric."""
    text = f"{sample.measure.text}: {sample.name} {_range(low, high)} {sample.measure.metric.unit}"
    if sample.missing:
        return undecided(text, [sample])
    estimate = mean_interval(sample.values)
    verdict = is_within(estimate, low, high)
    return Component(text, sample.measured, "mean", sample.measure.metric.unit, estimate, verdict, note=estimate.note)


def ratio_within(
    first: Sample, second: Sample, low: float, high: float = float("inf"), *, paired: bool = False
) -> Component:
    """That the ratio of two means, first / second, lies from ``low`` to ``high``."""
    text = f"{first.measure.text}: {first.name} / {second.name} {_range(low, high)}"
    return _share(text, [first, second], Contrast(first, second, paired).values, low, high, paired)


def difference_within(first: Sample, second: Sample, share: float, whole: Sample | None = None) -> Component:
    """That two states of the same networks differ by at most ``share`` of ``whole``, or of their own mean (None)."""
    of = whole.name if whole else "their mean"
    text = f"{first.measure.text}: {first.name} − {second.name} within ±{100 * share:g} % of {of}"
    samples = [first, second, *([whole] if whole else [])]
    table = pd.concat([sample.values for sample in samples], axis=1, join="inner").to_numpy(dtype=float)
    a, b = table[:, 0], table[:, 1]
    values = a - b, table[:, 2] if whole else (a + b) / 2
    return _share(text, samples, values, -share, share, paired=True, quantity=f"difference / {of}")


def undecided(text: str, samples: Sequence[Sample]) -> Component:
    """A component that cannot be decided, because some of ``samples`` have no numbers."""
    names = ", ".join(f"{sample.name} in {sample.measure.task}" for sample in samples if sample.missing)
    return Component(text, "", "", "", _NOTHING, "undecided", note=f"no results of {names}")


def _direction(contrast: Contrast, p: float, test: str, tukey_p: float = _NAN, rule: Rule = is_greater) -> Component:
    text = contrast.text if rule is is_greater else f"{contrast.text}, not conclusively"
    pair = [contrast.greater, contrast.lesser]
    if any(sample.missing for sample in pair):
        return undecided(text, pair)
    estimate = difference_interval(*contrast.values, paired=contrast.paired)
    matters = SMALLEST_EFFECT * sum(abs(sample.mean) for sample in pair) / 2
    unit = contrast.greater.measure.metric.unit.replace("%", "points")
    verdict = rule(estimate, p, matters)
    return Component(text, _measured(pair), "difference", unit, estimate, verdict, test, p, tukey_p, estimate.note)


def _share(
    text: str,
    samples: Sequence[Sample],
    values: tuple[Float64, Float64],
    low: float,
    high: float,
    paired: bool,
    quantity: str = "ratio",
) -> Component:
    if any(sample.missing for sample in samples):
        return undecided(text, samples)
    estimate = ratio_interval(*values, paired=paired)
    verdict = is_within(estimate, low, high)
    return Component(text, _measured(samples), quantity, "", estimate, verdict, note=estimate.note)


def _measured(samples: Sequence[Sample]) -> str:
    return ", ".join(sample.measured for sample in samples)


def _range(low: float, high: float) -> str:
    if high == float("inf"):
        return f"at least {low:.4g}"
    return f"at most {high:.4g}" if low == -float("inf") else f"from {low:.4g} to {high:.4g}"
