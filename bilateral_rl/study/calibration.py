"""The weight penalty of a study, which the paper leaves open: chosen for claims C1 to C3, on unilateral models only."""

from __future__ import annotations

from bilateral_rl.config.parse import Values

CALIBRATED: dict[str, dict[str, float]] = {
    "bptt": {"random_reach": 1e-3, "hold_position": 3e-5},
    "ppo": {"random_reach": 1e-3, "hold_position": 3e-4},
}
"""λ by algorithm and task, where it was calibrated. ``docs/paper.md`` has the grids that these were chosen from; the
kind of penalty and the radii of the goals were chosen with those of ``bptt``. C4 to C14 are tests of what was chosen.
"""
CALIBRATED_FOR = ("C1", "C2", "C3")
"""The claims for which it was chosen."""
_PENALTY = ("penalty", "penalty_coefficient", "weight_penalty")


def calibrated_settings(algo: str, profile: str, task: str) -> Values:
    """Return the settings that a study's trainings take over those of `train`; none where nothing was calibrated."""
    if not _has_calibration(algo, profile) or task not in CALIBRATED[algo]:
        return {}
    coefficient = CALIBRATED[algo][task]
    if algo == "bptt":
        return {algo: {"penalty": "weights", "penalty_coefficient": coefficient}}
    return {algo: {"weight_penalty": coefficient}}


def is_calibrated(algo: str, profile: str, overrides: Values) -> bool:
    """Return whether a study's weight penalty is the calibrated one: it has one, and ``overrides`` set no other."""
    own = overrides.get(algo, {})
    return _has_calibration(algo, profile) and not any(name in own for name in _PENALTY)


def _has_calibration(algo: str, profile: str) -> bool:
    """The released code's penalty is its profile's."""
    return algo in CALIBRATED and not (algo == "bptt" and profile != "paper")
