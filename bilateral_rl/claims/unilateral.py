"""C1 to C3: what the losses do to one network (paper section 7)."""

from __future__ import annotations

from bilateral_rl.claims.claim import Component
from bilateral_rl.claims.components import Contrast, holm_family, mean_within, ratio_within
from bilateral_rl.claims.evidence import Evidence
from bilateral_rl.claims.margins import (
    COMPLETION_TOLERANCE,
    HOLD_RATIO,
    SPEED_RATIO,
    UNI_DL_COMPLETION,
    UNI_NDL_COMPLETION,
)


def completion_of_reaches(evidence: Evidence) -> list[Component]:
    """C1: how many reaches each loss completes.

    Only two models are compared, and before the others are trained: the test is a planned one, Welch's t.
    """
    dominant, non_dominant = (evidence.intact(evidence.completion, model) for model in ("uni_dl", "uni_ndl"))
    papers = ((dominant, UNI_DL_COMPLETION), (non_dominant, UNI_NDL_COMPLETION))
    sizes = [
        mean_within(sample, value - COMPLETION_TOLERANCE, value + COMPLETION_TOLERANCE) for sample, value in papers
    ]
    return [*sizes, *holm_family([Contrast(dominant, non_dominant)])]


def speed_of_reaches(evidence: Evidence) -> list[Component]:
    """C2: the dominant loss reaches faster."""
    dominant, non_dominant = (evidence.intact(evidence.speed, model) for model in ("uni_dl", "uni_ndl"))
    return [ratio_within(dominant, non_dominant, *SPEED_RATIO)]


def time_of_holding(evidence: Evidence) -> list[Component]:
    """C3: the non-dominant loss holds longer."""
    dominant, non_dominant = (evidence.intact(evidence.hold, model) for model in ("uni_dl", "uni_ndl"))
    return [ratio_within(non_dominant, dominant, *HOLD_RATIO)]
