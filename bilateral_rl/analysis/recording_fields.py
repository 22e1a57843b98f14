"""What is recorded of trials: every quantity with its unit, its dimensions and what it means, defined once."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from operator import attrgetter
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.analysis.trial_plans import CONDITIONS, NULL_FIELD
from bilateral_rl.envs.arm.parameters import MUSCLE_NAMES
from bilateral_rl.envs.arm.physics import ACTIVATION, FORCE, LENGTH, VELOCITY
from bilateral_rl.envs.spring_forces import forces_of_springs
from bilateral_rl.envs.trials import TrialBatch
from bilateral_rl.policies.motor_network import MotorNetwork
from bilateral_rl.policies.networks import BilateralNetwork
from bilateral_rl.vocabulary import SIDES

Float32 = NDArray[np.float32]

TRIAL, TIME, STEP = "trial", "time", "step"
"""The dimensions that grow with a recording: trials; T + 1 moments, from the start on; the T steps between them."""
ARM = "arm"
"""The dimension that recordings of two arms have for whatever each arm, or its hand, has of its own."""

_MUSCLES = tuple(name.replace(" ", "_") for name in MUSCLE_NAMES)
_AXES = ("x", "y")
_WRITTEN = [NULL_FIELD if condition == "null" else condition for condition in CONDITIONS]
LABELS: dict[str, tuple[str, ...]] = {
    "joint": ("shoulder", "elbow"),
    "axis": _AXES,
    ARM: SIDES,
    "muscle": _MUSCLES,
    "side": SIDES,
    "observed": (
        *(f"length_{muscle}" for muscle in _MUSCLES),
        *(f"velocity_{muscle}" for muscle in _MUSCLES),
        *(f"{what}_{axis}_m" for what in ("hand", "target") for axis in _AXES),
    ),
    "view": (
        *(f"length_{muscle}" for muscle in _MUSCLES),
        *(f"velocity_{muscle}" for muscle in _MUSCLES),
        *(f"{whose}_{what}_{axis}_m" for what in ("hand", "target") for whose in ("own", "other") for axis in _AXES),
    ),
}
"""The names along each dimension that has names; layers and units of a network are numbered from 1."""
_ORIGIN = ", the shoulder at the origin"
_IN_BODY = "; in the frame of the body"
_FRAME_WORDS = {
    "none": "",
    "own": "; in the arm's own frame, with the shoulder at the origin and x away from the midline",
    "position": f"{_IN_BODY}, with the midline at x = 0, the dominant side at x > 0, and the shoulders at y = 0",
    "vector": _IN_BODY,
    "angle": _IN_BODY,
}
_OF_AN_ARM = ("joint", "axis", "muscle", "observed")

_IN_COLUMNS = {"": "", "m": "_m", "rad": "_rad", "m/s": "_m_per_s", "rad/s": "_rad_per_s", "N": "_N", "step": "_step"}
"""How the name of a table's column ends, by unit."""


@dataclass(frozen=True)
class Field:
    """One recorded quantity."""

    name: str
    dims: tuple[str, ...]
    """Its dimensions after the trial: ``time`` or ``step`` or neither, then what it is of, such as ``muscle``."""
    unit: str
    """Its unit, or "" for a number without one."""
    description: str
    """What it is, in words."""
    take: Callable[[TrialBatch], Float32] | None = field(default=None, compare=False, repr=False)
    """Returns its values from arms at a moment, or after a step; None for what is computed from other quantities."""
    before: bool = False
    """Whether the values of a step are taken before it."""
    of: Literal["arm", "trial"] = "arm"
    """Whether each of two arms has one, or the trial as a whole."""
    frame: Literal["none", "own", "position", "vector", "angle"] = "none"
    """What it is in its arm's own frame; a position, vector or angle is another one in the frame of the body."""

    @property
    def of_two_arms(self) -> Field:
        """The same field in a recording of two arms: with a dimension for them before what each has."""
        if self.of == "trial":
            return self
        each = self.dims[-1:] if self.dims and self.dims[-1] in _OF_AN_ARM else ()
        before = self.dims[: len(self.dims) - len(each)]
        dims = (*before, ARM, *("view" if dim == "observed" else dim for dim in each))
        return replace(
            self, dims=dims, description=f"{self.description.replace(_ORIGIN, '')}{_FRAME_WORDS[self.frame]}"
        )

    def columns(self, shape: tuple[int, ...]) -> list[str]:
        """Return the names of a table's columns for an array of this ``shape``, in the order of its last axes."""
        sizes = shape[len(shape) - len(self.places) :]
        names = [_labels(dim, size) for dim, size in zip(self.places, sizes, strict=True)]
        return [f"{'_'.join((self.name, *place))}{_IN_COLUMNS[self.unit]}" for place in itertools.product(*names)]

    @property
    def places(self) -> tuple[str, ...]:
        """The dimensions other than trial, time and step."""
        return tuple(dim for dim in self.dims if dim not in (TIME, STEP))


def _labels(dim: str, size: int) -> tuple[str, ...]:
    return LABELS[dim] if dim in LABELS else tuple(f"{dim}{i + 1}" for i in range(size))


# Functions and not lambdas, so that recordings can be pickled.
def _angles(batch: TrialBatch) -> Float32:
    return batch.joint[:, :2]


def _angular_velocities(batch: TrialBatch) -> Float32:
    return batch.joint[:, 2:]


def _muscle(row: int, batch: TrialBatch) -> Float32:
    return batch.muscle[:, row]


def _distance(batch: TrialBatch) -> Float32:
    clock = int(batch.clock[0])  # all arms begin their trials together
    return batch.distance[:, clock - 1] if clock else batch.start_distance


# fmt: off
STATES = (
    Field("joint_angle", (TIME, "joint"), "rad",
          "angle of the joint: of the upper arm to the x axis, of the forearm to the upper arm",
          _angles, frame="own"),
    Field("joint_velocity", (TIME, "joint"), "rad/s", "angular velocity of the joint",
          _angular_velocities),
    Field("hand", (TIME, "axis"), "m", f"position of the hand{_ORIGIN}", attrgetter("hand"),
          frame="position"),
    Field("hand_velocity", (TIME, "axis"), "m/s", "velocity of the hand, from the joints' velocities", frame="vector"),
    Field("distance", (TIME,), "m", "distance from hand to target", _distance),
    Field("activation", (TIME, "muscle"), "", "activation of the muscle, from its minimum to 1",
          partial(_muscle, ACTIVATION)),
    Field("muscle_length", (TIME, "muscle"), "m",
          "length of the muscle without its tendon, at the posture one step before (the arm's equations lag so)",
          partial(_muscle, LENGTH)),
    Field("muscle_velocity", (TIME, "muscle"), "m/s",
          "velocity of the muscle, positive where it lengthens, at the posture one step before",
          partial(_muscle, VELOCITY)),
    Field("muscle_force", (TIME, "muscle"), "N",
          "force of the muscle, from its present activation and the length and velocity given here; it acts in the "
          "step that begins now",
          partial(_muscle, FORCE)),
)
"""What there is at each moment."""
SPRING_FORCE = Field(
    "spring_force", (TIME, "axis"), "N",
    "force on the hand of the spring and the damper between both; it acts in the step that begins now; of two arms "
    "alone",
    forces_of_springs, frame="vector")
OBSERVATION = Field(
    "observation", (STEP, "observed"), "",
    "what the policy saw when the step began, with noise and delay: muscle lengths (optimal lengths), muscle "
    "velocities (maximal velocities), hand and target (m)",
    attrgetter("observation"), before=True, frame="own")
SEEN_TARGET = Field(
    "seen_target", (STEP, "axis"), "m",
    "position of the target that was seen when the step began, and by which the step is judged: until the go cue where "
    "the hand started",
    attrgetter("target"), before=True, frame="position")
HAND_FORCE = Field("force", (STEP, "axis"), "N",
                   "whole force on the hand in the step: load, fields, pulse, channel and spring", attrgetter("force"),
                   frame="vector")
FIELD_FORCE = Field(
    "field_force", (STEP, "axis"), "N",
    "force that the field of the experiment has at the hand's position and velocity when the step began, also in "
    "trials in which it is off or a channel takes its place; of experiments with forces alone", frame="vector")
STEPS = (
    OBSERVATION,
    SEEN_TARGET,
    HAND_FORCE,
    FIELD_FORCE,
    Field("excitation", (STEP, "muscle"), "", "command to the muscle, in [0, 1], held for the step; before motor noise",
          attrgetter("excitation")),
    Field("reward", (STEP, "side"), "", "reward for the step, from the hand at its end and the excitations in it",
          attrgetter("vector_reward"), of="trial"),
)
"""What there is in each step."""
TARGET = Field("target", ("axis",), "m", "position of the last target of the trial", frame="position")
OF_EXPERIMENTS = (
    Field("go", (), "step",
          "step from which on the target is seen, 0 where it is there from the start; none where no cue comes"),
    Field("jump", (), "step", "step from which on the target is another one; none where it does not jump"),
    Field("target_angle", (), "rad",
          "direction from the hand at the start to the goal, counterclockwise from x; none where both are one place",
          frame="angle"),
)
"""What sets a trial apart where the trials of a task have cues, forces, or listed targets."""
TRIALS = (
    TARGET,
    Field("load", ("axis",), "N", "load on the hand, the same throughout the trial", attrgetter("load"),
          frame="vector"),
    *OF_EXPERIMENTS,
)
"""What sets a trial apart."""
_HIDDEN = "activity (tanh) of the unit of the hidden layer, on the observation of the step, with the lesion"
HIDDEN_OF_SIDES = Field("hidden", (STEP, "layer", "side", "unit"), "",
                        f"{_HIDDEN}; its own, before what the callosum adds to it on the way to the next layer",
                        of="trial")
HIDDEN = Field("hidden", (STEP, "layer", "unit"), "", _HIDDEN, of="trial")
CONTRIBUTION = Field("contribution", (STEP, "side", "muscle"), "",
                     "what the side adds to the command before its sigmoid, which is both and the output layer's bias; "
                     "0 for a side with a deep lesion")
# fmt: on
# fmt: off
ROLE = Field("role", (), "", "what the hand is to do, reach or hold; of two arms alone")
LABEL_FIELDS = (
    Field("seed", (), "", "seed of the network", of="trial"),
    Field("lesion", (), "", "lesion of the network, or intact", of="trial"),
    Field("trial", (), "",
          "number of the trial, from 0: the first trial of the seed `trial_seed` (in the metadata) plus this number; "
          "where either of two arms may have either part, that holds for even numbers, and the next trial is the same "
          "with the arms exchanged",
          of="trial"),
    Field("condition", (), "",
          f"what is special of the trial: {', '.join(_WRITTEN)}, or several joined by +; of experiments alone"),
    Field("target_index", (), "",
          "which of the listed targets it is, from 0, of two arms numbered through; -1 without a list; of experiments "
          "alone"),
    ROLE,
)
# fmt: on
"""What says which trial of which network this is."""
LABEL_NAMES = frozenset(label.name for label in LABEL_FIELDS)
HAND_VELOCITY = next(f for f in STATES if f.name == "hand_velocity")
MEASURED = (
    *(f for f in STATES if f.name in ("joint_angle", "joint_velocity", "hand", "activation")),
    *(f for f in STEPS if f.name != "reward"),
    *(f for f in TRIALS if f not in OF_EXPERIMENTS),
)
"""What trials are measured by; the rest is for recordings."""
EVERY_FIELD = (*LABEL_FIELDS, *STATES, SPRING_FORCE, *STEPS, HIDDEN_OF_SIDES, HIDDEN, CONTRIBUTION, *TRIALS)
"""Every field there is, in the order of tables; ``hidden`` twice, for networks with and without sides."""


OF_TWO_ARMS = (ROLE, SPRING_FORCE)
"""What recordings of two arms alone have."""


def fields_of(network: MotorNetwork) -> tuple[Field, ...]:
    """Return the fields of a recording of ``network``, in the order of tables, as one arm has them."""
    other = {HIDDEN} if isinstance(network, BilateralNetwork) else {HIDDEN_OF_SIDES, CONTRIBUTION}
    if network.n_arms == 1:
        other |= {*OF_TWO_ARMS}
    return tuple(f for f in EVERY_FIELD if f not in other)
