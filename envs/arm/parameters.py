"""Every constant of the arm, with its unit and source."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

MUSCLE_NAMES = ("pectoralis", "deltoid", "brachioradialis", "triceps lateral", "biceps", "triceps long")
"""The six lumped muscles, in the order of every array's last axis."""

N_MUSCLES = len(MUSCLE_NAMES)
N_JOINTS = 2

PerJoint = tuple[float, float]
PerMuscle = tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class ArmParameters:
    """Parameters of the planar two-joint, six-muscle arm (paper section 2; MotorNet's ``RigidTendonArm26``).

    Tuples are per joint (shoulder, elbow), per link (upper arm, forearm) or per muscle (``MUSCLE_NAMES``).
    Skeleton and muscle geometry: Nijhof & Kouwenhoven 2000 (doi:10.1007/978-1-4612-2104-3_29). Muscle curves:
    Kistemaker et al. 2010 (doi:10.1152/jn.00483.2010). Activation dynamics: Thelen 2003 (doi:10.1115/1.1531112).

    Raises:
        ValueError: a tuple of the wrong length, a number that is not finite, or one outside its physical range.
    """

    timestep: float = 0.01
    """Explicit Euler step (s)."""

    # Skeleton
    link_mass: PerJoint = (1.82, 1.43)
    """kg."""
    link_center_of_mass: PerJoint = (0.135, 0.165)
    """Distance from the link's proximal joint (m)."""
    link_inertia: PerJoint = (0.051, 0.057)
    """About the center of mass (kg m²)."""
    link_length: PerJoint = (0.309, 0.333)
    """m."""
    joint_lower_limit: PerJoint = (0.0, 0.0)
    """rad."""
    joint_upper_limit: PerJoint = (math.radians(135.0), math.radians(155.0))
    """rad."""

    # Muscle and tendon
    max_isometric_force: PerMuscle = (838.0, 1207.0, 1422.0, 1549.0, 414.0, 603.0)
    """N."""
    tendon_length: PerMuscle = (0.039, 0.066, 0.172, 0.187, 0.204, 0.217)
    """m; the tendon is rigid."""
    optimal_muscle_length: PerMuscle = (0.134, 0.140, 0.092, 0.093, 0.137, 0.127)
    """m."""
    normalized_slack_muscle_length: float = 1.0
    """Length (in optimal lengths) past which a muscle resists passively. 1.0 is the paper's arm (motornet 0.1.5);
    motornet 0.2 and later default to 1.4, which is a very different arm."""
    normalized_max_velocity: float = 10.0
    """Maximal shortening velocity (optimal lengths/s)."""

    # Activation
    min_activation: float = 0.001
    tau_activation: float = 0.015
    """s."""
    tau_deactivation: float = 0.05
    """s."""

    # Musculotendon path: length = offset + Σ_joints (linear + quadratic · p) · p with p = angle − reference angle;
    # its derivative, linear + 2 · quadratic · p, is the moment arm.
    path_offset: PerMuscle = (0.151, 0.2322, 0.2859, 0.2355, 0.3329, 0.2989)
    """m."""
    path_linear_shoulder: PerMuscle = (-0.03, 0.03, 0.0, 0.0, -0.03, 0.03)
    """m/rad."""
    path_linear_elbow: PerMuscle = (0.0, 0.0, -0.014, 0.025, -0.016, 0.03)
    """m/rad."""
    path_quadratic_shoulder: PerMuscle = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    """m/rad²."""
    path_quadratic_elbow: PerMuscle = (0.0, 0.0, -0.004, -0.0022, -0.0057, -0.0032)
    """m/rad²."""
    path_reference_angle: PerJoint = (math.pi / 2, 0.0)
    """rad."""

    # Hill curves, dimensionless
    active_width: float = 0.66
    """Half width of the active force-length parabola (optimal lengths); passive force is maximal there too."""
    min_active_force_length: float = 0.01
    """Floor of the active force-length curve."""
    hill_a: float = 0.41
    """Hill's a over maximal isometric force."""
    hill_b: float = 5.2
    """Hill's b over optimal length (1/s, halved by the unit of vmax as in the source)."""
    low_activation: float = 0.3
    """Activation under which hill_b falls."""
    low_activation_origin: float = 0.005
    """Activation at which hill_b has fallen by ``low_activation_drop``."""
    low_activation_drop: float = 0.9
    lengthening_force: float = 1.5
    """Asymptote of the lengthening (eccentric) curve, in isometric forces."""
    lengthening_slope_ratio: float = 2.0
    """Slope of the force-velocity curve just above zero velocity over the slope just below."""
    lengthening_asymptote_slope: float = 0.001

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(field.default, tuple):
                _check_tuple(field.name, value, len(field.default))
            elif not isinstance(value, (int, float)) or not math.isfinite(value):
                raise ValueError(f"ArmParameters.{field.name} must be a finite number, got {value!r}.")
        _check_signs(self)
        for lower, upper in zip(self.joint_lower_limit, self.joint_upper_limit, strict=True):
            if not lower < upper:
                raise ValueError(f"a joint_lower_limit must be below its joint_upper_limit, got {lower} and {upper}.")
        if not 0 < self.min_activation < 1:
            raise ValueError(f"min_activation must lie between 0 and 1, got {self.min_activation}.")
        if not self.low_activation_origin < self.low_activation:
            raise ValueError(
                f"low_activation ({self.low_activation}) must be above low_activation_origin "
                f"({self.low_activation_origin})."
            )
        if not self.lengthening_force > 1:
            raise ValueError(f"lengthening_force must be above the isometric force, 1, got {self.lengthening_force}.")
        if not self.normalized_slack_muscle_length < 1 + self.active_width:
            raise ValueError(
                "normalized_slack_muscle_length must be below 1 + active_width "
                f"({1 + self.active_width}), got {self.normalized_slack_muscle_length}."
            )

    def to_dict(self) -> dict[str, Any]:
        """The parameters as plain numbers and lists, for a configuration file."""
        return {name: list(v) if isinstance(v, tuple) else v for name, v in dataclasses.asdict(self).items()}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> ArmParameters:
        """The inverse of :meth:`to_dict`. Raises ValueError for an unknown name."""
        known = {field.name for field in dataclasses.fields(cls)}
        unknown = sorted(set(values) - known)
        if unknown:
            raise ValueError(f"unknown arm parameters {unknown}; choose from {sorted(known)}.")
        arguments: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()}
        return cls(**arguments)


_POSITIVE = (
    "timestep", "link_mass", "link_inertia", "link_length", "max_isometric_force", "optimal_muscle_length",
    "normalized_slack_muscle_length", "normalized_max_velocity", "tau_activation", "tau_deactivation", "active_width",
    "min_active_force_length", "hill_a", "hill_b",
)  # fmt: skip

_NOT_NEGATIVE = (
    "link_center_of_mass", "tendon_length", "low_activation_origin", "low_activation_drop", "lengthening_slope_ratio",
    "lengthening_asymptote_slope",
)  # fmt: skip


def _check_tuple(name: str, value: Any, length: int) -> None:
    if not isinstance(value, tuple) or len(value) != length:
        raise ValueError(f"ArmParameters.{name} must be a tuple of {length} numbers, got {value!r}.")
    if not all(isinstance(v, (int, float)) and math.isfinite(v) for v in value):
        raise ValueError(f"ArmParameters.{name} must hold finite numbers, got {value!r}.")


def _check_signs(parameters: ArmParameters) -> None:
    for name in (*_POSITIVE, *_NOT_NEGATIVE):
        value = getattr(parameters, name)
        least = min(value if isinstance(value, tuple) else (value,))
        if least < 0 or (least == 0 and name in _POSITIVE):
            wanted = "positive" if name in _POSITIVE else "at least 0"
            raise ValueError(f"ArmParameters.{name} must be {wanted}, got {value!r}.")
