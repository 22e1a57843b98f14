"""The memory of trials: the structs that kernels see, and their arrays, zeros at first, on the device."""

from __future__ import annotations

from typing import Any, NamedTuple

import warp as wp
from numpy.typing import NDArray

from bilateral_rl.envs.arm.parameters import N_MUSCLES, ArmParameters
from bilateral_rl.envs.arm.physics import arm_types
from bilateral_rl.envs.forces import affine_forces
from bilateral_rl.envs.kinematics import hand_position
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.task import PLACES, Trials

_, vec2, vec4, vec6, rows, Parameters = arm_types(wp.float32)
mat22 = wp.types.matrix((2, 2), wp.float32)
steps2 = wp.types.vector(2, wp.int32)

N_SENSED = 2 * N_MUSCLES + 2
"""Numbers that the arm senses: muscle lengths, muscle velocities, hand x and y."""
N_OBSERVED = N_SENSED + 2
"""What a controller sees: the sensed numbers and the target's x and y."""
N_NOISE = N_SENSED + N_MUSCLES
"""Normal numbers a step takes: one per sensed number, one per muscle command."""


class Features(NamedTuple):
    """What trials have beyond the paper's; without any, kernels are those of its two tasks and cost nothing more."""

    timeline: bool = False
    """A cue to go, or a target that jumps."""
    forces: bool = False
    """Forces on the hand beside the load."""
    further_terms: bool = False
    """Losses beyond the paper's three terms over all steps."""
    two_delays: bool = False
    """Muscles and hand that are sensed at different delays."""


@wp.struct
class TrialRows:
    """Trials that ``k`` arms begin. What a set of features does not have is empty."""

    start: wp.array(dtype=vec2)  # (k,) rad
    goal: wp.array(dtype=vec2)  # (k,) rad
    load: wp.array(dtype=vec2)  # (k,) N
    # Of a timeline:
    go: wp.array(dtype=wp.int32)  # (k,) steps
    jump: wp.array(dtype=wp.int32)  # (k,) steps
    jump_goal: wp.array(dtype=vec2)  # (k,) rad
    # Of forces:
    offset: wp.array(dtype=vec2)  # (k,) N
    velocity_gain: wp.array(dtype=mat22)  # (k,) N s/m
    position_gain: wp.array(dtype=mat22)  # (k,) N/m
    pulse: wp.array(dtype=vec2)  # (k,) N
    pulse_window: wp.array(dtype=steps2)  # (k,) first step, and first step after it


@wp.struct
class TrialArrays:
    """State and outputs of ``n`` arms, each with its own clock. T is the trial's length in steps."""

    clock: wp.array(dtype=wp.int32)  # (n,) steps taken; T: in no trial
    joint: wp.array(dtype=vec4)  # (n,)
    muscle: wp.array(dtype=rows)  # (n,)
    hand: wp.array(dtype=vec2)  # (n,) m
    target: wp.array(dtype=vec2)  # (n,) m, seen now
    load: wp.array(dtype=vec2)  # (n,) N
    noise: wp.array3d(dtype=wp.float32)  # (n, T + 1, N_NOISE) already scaled; (n, 1, N_NOISE) zeros without noise
    sensed: wp.array3d(dtype=wp.float32)  # (n, longest delay + 1, N_SENSED) ring of what was sensed last
    muscle_delay: wp.int32  # steps
    hand_delay: wp.int32  # steps
    observation: wp.array2d(dtype=wp.float32)  # (n, N_OBSERVED)
    observation_low: wp.array(dtype=wp.float32)  # (N_OBSERVED,)
    observation_high: wp.array(dtype=wp.float32)  # (N_OBSERVED,)
    excitation: wp.array(dtype=vec6)  # (n,) command of the last step, in [0, 1], without motor noise
    vector_reward: wp.array(dtype=vec2)  # (n,) dominant, non-dominant
    reward: wp.array(dtype=wp.float32)  # (n,) their mean
    vector_return: wp.array(dtype=vec2)  # (n,) sum of the vector reward since the start
    start_distance: wp.array(dtype=wp.float32)  # (n,) m, at the onset
    distance: wp.array2d(dtype=wp.float32)  # (n, T) hand to target after each step (m)


@wp.struct
class TimelineArrays:
    """The timelines of ``n`` arms; empty without such. A struct of its own, as every call copies what it is given."""

    onset: wp.array(dtype=wp.int32)  # (n,) step at which the present target began; T before the cue
    go: wp.array(dtype=wp.int32)  # (n,) step from which on the goal is the target
    jump: wp.array(dtype=wp.int32)  # (n,) step from which on the target is where it jumps to
    goal_target: wp.array(dtype=vec2)  # (n,) m
    jump_target: wp.array(dtype=vec2)  # (n,) m


@wp.struct
class ForceArrays:
    """The forces on ``n`` hands beside their loads; empty without such."""

    force: wp.array(dtype=vec2)  # (n,) N, all of it in the last step
    offset: wp.array(dtype=vec2)  # (n,) N
    velocity_gain: wp.array(dtype=mat22)  # (n,) N s/m
    position_gain: wp.array(dtype=mat22)  # (n,) N/m
    pulse: wp.array(dtype=vec2)  # (n,) N
    pulse_window: wp.array(dtype=steps2)  # (n,)


class BatchArrays(NamedTuple):
    """The memory of ``n`` arms, as kernels see it."""

    trials: TrialArrays
    timelines: TimelineArrays
    forces: ForceArrays
    named: dict[str, Any]
    """Every array of the three that there is, by its name; without forces, ``force`` is the load."""


OF_TIMELINE = ("onset", "go", "jump", "goal_target", "jump_target")
"""Names of the arrays of a timeline."""
OF_FORCES = ("force", "offset", "velocity_gain", "position_gain", "pulse", "pulse_window")
"""Names of the arrays of forces."""


def allocate(settings: TrialSettings, features: Features, n: int, device: str) -> BatchArrays:
    """Return the memory of ``n`` arms on ``device``, in no trial."""
    length = settings.trial_length
    vectors, matrices, steps = ((n,), vec2), ((n,), mat22), ((n,), wp.int32)
    shapes: dict[str, tuple[tuple[int, ...], Any]] = {
        "clock": steps,
        "joint": ((n,), vec4),
        "muscle": ((n,), rows),
        "hand": vectors,
        "target": vectors,
        "load": vectors,
        "noise": ((n, length + 1 if settings.noisy else 1, N_NOISE), wp.float32),
        "sensed": ((n, max(settings.delays) + 1, N_SENSED), wp.float32),
        "observation": ((n, N_OBSERVED), wp.float32),
        "excitation": ((n,), vec6),
        "vector_reward": vectors,
        "reward": ((n,), wp.float32),
        "vector_return": vectors,
        "start_distance": ((n,), wp.float32),
        "distance": ((n, length), wp.float32),
        "onset": steps,
    }
    if features.timeline:
        shapes |= {"go": steps, "jump": steps, "goal_target": vectors, "jump_target": vectors}
    if features.forces:
        shapes |= {"force": vectors, "offset": vectors, "pulse": vectors, "pulse_window": ((n,), steps2)}
        shapes |= {"velocity_gain": matrices, "position_gain": matrices}
    named = {name: wp.zeros(shape, dtype=dtype, device=device) for name, (shape, dtype) in shapes.items()}
    named.setdefault("force", named["load"])
    named["clock"].fill_(length)
    arrays = BatchArrays(TrialArrays(), TimelineArrays(), ForceArrays(), named)
    for name, array in named.items():
        part = arrays.timelines if name in OF_TIMELINE else arrays.forces if name in OF_FORCES else arrays.trials
        setattr(part, name, array)
    arrays.trials.muscle_delay, arrays.trials.hand_delay = map(wp.int32, settings.delays)
    low, high = settings.observation_bounds()
    arrays.trials.observation_low = wp.array(low, dtype=wp.float32, device=device)
    arrays.trials.observation_high = wp.array(high, dtype=wp.float32, device=device)
    return arrays


def trial_rows(trials: Trials, arm: ArmParameters, device: str) -> TrialRows:
    """Return checked trials as kernels take them."""
    given: dict[str, tuple[NDArray[Any], Any]] = {name: (getattr(trials, name), vec2) for name in PLACES}
    if trials.timeline is not None:
        go, jump, jump_goal = trials.timeline
        given |= {"go": (go, wp.int32), "jump": (jump, wp.int32), "jump_goal": (jump_goal, vec2)}
    if trials.forces is not None:
        affine = affine_forces(trials.forces, hand_position(trials.start, arm), hand_position(trials.goal, arm))
        given |= {
            "offset": (affine.offset, vec2),
            "velocity_gain": (affine.velocity_gain, mat22),
            "position_gain": (affine.position_gain, mat22),
            "pulse": (trials.forces.pulse, vec2),
            "pulse_window": (trials.forces.pulse_window, steps2),
        }
    rows = TrialRows()
    for name, (values, dtype) in given.items():
        setattr(rows, name, wp.array(values, dtype=dtype, device=device))
    return rows
