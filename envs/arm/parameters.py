"""Every constant of the arm, with its unit and source."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from bilateral_rl.envs.quantities import STRICT, NotNegative, Number, Positive
from bilateral_rl.envs.refusals import refusing_in_a_sentence

MUSCLE_NAMES = ("pectoralis", "deltoid", "brachioradialis", "triceps lateral", "biceps", "triceps long")
"""The six lumped muscles, in the order of every array's last axis."""

N_MUSCLES = len(MUSCLE_NAMES)

PerJoint = tuple[Number, Number]
PositivePerJoint = tuple[Positive, Positive]
NotNegativePerJoint = tuple[NotNegative, NotNegative]
PerMuscle = tuple[Number, Number, Number, Number, Number, Number]
PositivePerMuscle = tuple[Positive, Positive, Positive, Positive, Positive, Positive]
NotNegativePerMuscle = tuple[NotNegative, NotNegative, NotNegative, NotNegative, NotNegative, NotNegative]


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class ArmParameters:
    """Parameters of the planar two-joint, six-muscle arm (paper section 2; MotorNet's ``RigidTendonArm26``).

    Tuples are per joint (shoulder, elbow), per link (upper arm, forearm) or per muscle (``MUSCLE_NAMES``).
    Skeleton and muscle geometry: Nijhof & Kouwenhoven 2000 (doi:10.1007/978-1-4612-2104-3_29). Muscle curves:
    Kistemaker et al. 2010 (doi:10.1152/jn.00483.2010). Activation dynamics: Thelen 2003 (doi:10.1115/1.1531112).

    Raises:
        ValueError: an unknown name, another number of values, or a value that is not finite or outside its physical
            range.
    """

    timestep: Positive = 0.01
    """Explicit Euler step (s)."""

    # Skeleton
    link_mass: PositivePerJoint = (1.82, 1.43)
    """Mass of each link (kg)."""
    link_center_of_mass: NotNegativePerJoint = (0.135, 0.165)
    """Distance from the link's proximal joint (m)."""
    link_inertia: PositivePerJoint = (0.051, 0.057)
    """Moment of inertia of each link about its center of mass (kg m²)."""
    link_length: PositivePerJoint = (0.309, 0.333)
    """Length of each link (m)."""
    joint_lower_limit: PerJoint = (0.0, 0.0)
    """Smallest angle of each joint (rad)."""
    joint_upper_limit: PerJoint = (math.radians(135.0), math.radians(155.0))
    """Largest angle of each joint (rad)."""

    # Muscle and tendon
    max_isometric_force: PositivePerMuscle = (838.0, 1207.0, 1422.0, 1549.0, 414.0, 603.0)
    """Largest force of each muscle at its optimal length, neither shortening nor lengthening (N)."""
    tendon_length: NotNegativePerMuscle = (0.039, 0.066, 0.172, 0.187, 0.204, 0.217)
    """Length of each tendon, which is rigid (m)."""
    optimal_muscle_length: PositivePerMuscle = (0.134, 0.140, 0.092, 0.093, 0.137, 0.127)
    """Length at which each muscle is strongest (m)."""
    normalized_slack_muscle_length: Positive = 1.0
    """Length (optimal lengths) past which a muscle resists passively. 1.0 is the paper's arm (motornet 0.1.5);
    motornet 0.2 and later default to 1.4, which is a very different arm."""
    normalized_max_velocity: Positive = 10.0
    """Maximal shortening velocity (optimal lengths/s)."""

    # Activation
    min_activation: Annotated[Number, Field(gt=0, lt=1)] = 0.001
    """Activation that a muscle never falls below, and from which it starts."""
    tau_activation: Positive = 0.015
    """Time constant of a rising activation (s)."""
    tau_deactivation: Positive = 0.05
    """Time constant of a falling activation (s)."""

    # Musculotendon path: length = offset + Σ_joints (linear + quadratic · p) · p with p = angle − reference angle;
    # its derivative, linear + 2 · quadratic · p, is the moment arm.
    path_offset: PerMuscle = (0.151, 0.2322, 0.2859, 0.2355, 0.3329, 0.2989)
    """Length of each muscle with its tendon at the reference angles (m)."""
    path_linear_shoulder: PerMuscle = (-0.03, 0.03, 0.0, 0.0, -0.03, 0.03)
    """Moment arm of each muscle at the shoulder at its reference angle; negative flexes (m/rad)."""
    path_linear_elbow: PerMuscle = (0.0, 0.0, -0.014, 0.025, -0.016, 0.03)
    """Moment arm of each muscle at the elbow at its reference angle; negative flexes (m/rad)."""
    path_quadratic_shoulder: PerMuscle = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    """Half of how fast each moment arm at the shoulder changes with its angle (m/rad²)."""
    path_quadratic_elbow: PerMuscle = (0.0, 0.0, -0.004, -0.0022, -0.0057, -0.0032)
    """Half of how fast each moment arm at the elbow changes with its angle (m/rad²)."""
    path_reference_angle: PerJoint = (math.pi / 2, 0.0)
    """Angle of each joint from which its path is counted (rad)."""

    # Hill curves, dimensionless
    active_width: Positive = 0.66
    """Half width of the active force-length parabola (optimal lengths); passive force is maximal there too."""
    min_active_force_length: Positive = 0.01
    """Floor of the active force-length curve."""
    hill_a: Positive = 0.41
    """Hill's a over maximal isometric force."""
    hill_b: Positive = 5.2
    """Hill's b over optimal length (1/s); halved by the unit of vmax, as in the source."""
    low_activation: Number = 0.3
    """Activation under which ``hill_b`` falls."""
    low_activation_origin: NotNegative = 0.005
    """Activation at which ``hill_b`` has fallen to (1 − ``low_activation_drop``)² of itself."""
    low_activation_drop: NotNegative = 0.9
    """How far ``hill_b`` falls, see ``low_activation_origin``."""
    lengthening_force: Annotated[Number, Field(gt=1)] = 1.5
    """Asymptote of the lengthening (eccentric) curve, in isometric forces; a lengthening muscle resists more."""
    lengthening_slope_ratio: NotNegative = 2.0
    """Slope of the force-velocity curve just above zero velocity over the slope just below."""
    lengthening_asymptote_slope: NotNegative = 0.001
    """Slope that the lengthening curve keeps far out."""

    def __post_init__(self) -> None:
        for lower, upper in zip(self.joint_lower_limit, self.joint_upper_limit, strict=True):
            if not lower < upper:
                raise ValueError(f"joint_lower_limit must be below joint_upper_limit, got {lower} and {upper}")
        if not self.low_activation_origin < self.low_activation:
            raise ValueError(
                f"low_activation must be above low_activation_origin, got {self.low_activation} and "
                f"{self.low_activation_origin}"
            )
        if not self.normalized_slack_muscle_length < 1 + self.active_width:
            raise ValueError(
                f"normalized_slack_muscle_length must be below 1 + active_width, {1 + self.active_width}, got "
                f"{self.normalized_slack_muscle_length}"
            )
