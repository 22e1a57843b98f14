"""Goals by their radius: which radii are reported, and how a radius is written in the name of a metric.

``trial.threshold`` of a configuration is the radius of a run's own goal (m).
"""

from __future__ import annotations

from collections.abc import Iterable
from decimal import Decimal

from bilateral_rl.envs.tasks import HoldPosition, RandomReach

REPORTED_RADII = (0.02, 0.03, 0.05)
"""Goal radii that every evaluation reports (m; paper section 3)."""

STUDY_RADII = (0.01, *REPORTED_RADII)
"""Goal radii of the metrics in tables of results (m): with that by which studies judge holds."""

JUDGED_RADII = {RandomReach.id: 0.05, HoldPosition.id: 0.01}
"""Goal radius by which a study judges each task (m). The paper leaves it open; it was chosen for claims C1 to C3."""


def in_centimeters(radius: float) -> str:
    """Write a radius (m) in centimeters, to six significant digits and never with an exponent: "5", "4.5"."""
    return f"{Decimal(f'{100 * radius:.6g}'):f}"


def from_centimeters(text: str) -> float:
    """Read the radius (m) that :func:`in_centimeters` wrote."""
    return float(Decimal(text).scaleb(-2))


def distinct_radii(radii: Iterable[float]) -> list[float]:
    """Sort radii (m), and keep the last of those that are written alike, such as 0.05 and 0.05000001."""
    return sorted({in_centimeters(radius): radius for radius in radii}.values())
