"""By what a reading of the paper judges networks, where the paper leaves it open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from bilateral_rl.analysis.goals import JUDGED_RADII
from bilateral_rl.analysis.protocols import Protocol

ReachMeasure = Literal["completion", "speed"]
Arrival = Literal["first", "third"]
Depth = Literal["deep", "shallow"]


@dataclass(frozen=True)
class Criteria:
    """What the claims are judged by; the defaults are those of the paper's text as version 0.1.0 read it."""

    protocol: str = Protocol("output").name
    """Name of the protocol that followed a lesion."""
    measures: tuple[ReachMeasure, ...] = ("completion",)
    """By what a reach after a lesion is judged; a claim must hold by each of them."""
    radii: Mapping[str, float] = field(default_factory=lambda: dict(JUDGED_RADII))
    """Radius of the goal by task (m)."""
    arrival: Arrival = "first"
    """Which of the three steps within the goal ends a reach, for its speed."""
    alone: Depth = "deep"
    """Which lesion of the other side leaves a hemisphere to work alone."""
