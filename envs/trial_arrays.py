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
N_NOISE = N_SENSED + N_MUSCLES
"""Normal numbers a step of an arm takes: one per sensed number, one per muscle command."""


class Features(NamedTuple):
    """What trials have beyond the paper's; without any, kernels are those of its two tasks and cost nothing more."""

    arms: int = 1
    """Arms of one trial."""
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
    """Trials that begin, a row for each of ``k`` hands. What a set of features does not have is empty."""

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
    # Of two arms, a row for each trial:
    stiffness: wp.array(dtype=wp.float32)  # N/m
    damping: wp.array(dtype=wp.float32)  # N s/m


@wp.struct
class TrialArrays:
    """State and outputs of ``n`` trials, each with its own clock, and of their ``h`` hands. T is the length in steps.

    Arm a of trial i, and its hand, is row i · arms + a of what has ``h`` rows, which is in the frame of that arm.
    """

    clock: wp.array(dtype=wp.int32)  # (n,) steps taken; T: in no trial
    joint: wp.array(dtype=vec4)  # (h,)
    muscle: wp.array(dtype=rows)  # (h,)
    hand: wp.array(dtype=vec2)  # (h,) m
    target: wp.array(dtype=vec2)  # (h,) m, seen now
    load: wp.array(dtype=vec2)  # (h,) N
    noise: wp.array3d(dtype=wp.float32)  # (h, T + 1, N_NOISE) already scaled; (h, 1, N_NOISE) zeros without noise
    sensed: wp.array3d(dtype=wp.float32)  # (h, longest delay + 1, N_SENSED) ring of what was sensed last
    muscle_delay: wp.int32  # steps
    hand_delay: wp.int32  # steps
    observation: wp.array2d(dtype=wp.float32)  # (n, arms · view)
    observation_low: wp.array(dtype=wp.float32)  # (arms · view,)
    observation_high: wp.array(dtype=wp.float32)  # (arms · view,)
    excitation: wp.array(dtype=vec6)  # (h,) command of the last step, in [0, 1], without motor noise
    vector_reward: wp.array(dtype=vec2)  # (n,) dominant, non-dominant
    reward: wp.array(dtype=wp.float32)  # (n,) their mean
    vector_return: wp.array(dtype=vec2)  # (n,) sum of the vector reward since the start
    start_distance: wp.array(dtype=wp.float32)  # (h,) m, at the onset
    distance: wp.array2d(dtype=wp.float32)  # (h, T) hand to target after each step (m)


@wp.struct
class TimelineArrays:
    """The timelines of ``h`` hands; empty without such. A struct of its own, as every call copies what it is given."""

    onset: wp.array(dtype=wp.int32)  # (h,) step at which the present target began; T before the cue
    go: wp.array(dtype=wp.int32)  # (h,) step from which on the goal is the target
    jump: wp.array(dtype=wp.int32)  # (h,) step from which on the target is where it jumps to
    goal_target: wp.array(dtype=vec2)  # (h,) m
    jump_target: wp.array(dtype=vec2)  # (h,) m


@wp.struct
class ForceArrays:
    """The forces on ``h`` hands beside their loads, and the springs of ``n`` trials of two; empty without such."""

    force: wp.array(dtype=vec2)  # (h,) N, all of it in the last step
    offset: wp.array(dtype=vec2)  # (h,) N
    velocity_gain: wp.array(dtype=mat22)  # (h,) N s/m
    position_gain: wp.array(dtype=mat22)  # (h,) N/m
    pulse: wp.array(dtype=vec2)  # (h,) N
    pulse_window: wp.array(dtype=steps2)  # (h,)
    stiffness: wp.array(dtype=wp.float32)  # (n,) N/m
    damping: wp.array(dtype=wp.float32)  # (n,) N s/m
    rest: wp.array(dtype=vec2)  # (n,) m, from the dominant to the other hand at the start, in the dominant arm's frame
    of_distance: wp.bool  # whether springs hold the distance alone
    shoulder_distance: wp.float32  # m


class BatchArrays(NamedTuple):
    """The memory of ``n`` trials, as kernels see it."""

    trials: TrialArrays
    timelines: TimelineArrays
    forces: ForceArrays
    named: dict[str, Any]
    """Every array of the three that there is, by its name; where nothing else acts, ``force`` is the load."""


OF_TIMELINE = ("onset", "go", "jump", "goal_target", "jump_target")
"""Names of the arrays of a timeline."""
OF_FORCES = ("force", "offset", "velocity_gain", "position_gain", "pulse", "pulse_window")
"""Names of the arrays of forces."""
OF_SPRING = ("stiffness", "damping", "rest")
"""Names of the arrays of springs."""


def state_names(features: Features) -> tuple[str, ...]:
    """Return the names of the arrays that trials with ``features`` have and those without do not."""
    timeline = OF_TIMELINE if features.timeline else ()
    forces = OF_FORCES if features.forces else OF_FORCES[:1] if features.arms > 1 else ()
    return (*timeline, *forces, *(OF_SPRING if features.arms > 1 else ()))


def allocate(settings: TrialSettings, features: Features, n: int, device: str) -> BatchArrays:
    """Return the memory of ``n`` trials on ``device``, none of which has begun."""
    length, h = settings.trial_length, n * features.arms
    low, high = settings.observation_bounds(features.arms)
    vectors, matrices, steps, numbers = ((h,), vec2), ((h,), mat22), ((h,), wp.int32), ((n,), wp.float32)
    shapes: dict[str, tuple[tuple[int, ...], Any]] = {
        "clock": ((n,), wp.int32),
        "joint": ((h,), vec4),
        "muscle": ((h,), rows),
        "hand": vectors,
        "target": vectors,
        "load": vectors,
        "noise": ((h, length + 1 if settings.noisy else 1, N_NOISE), wp.float32),
        "sensed": ((h, max(settings.delays) + 1, N_SENSED), wp.float32),
        "observation": ((n, len(low)), wp.float32),
        "excitation": ((h,), vec6),
        "vector_reward": ((n,), vec2),
        "reward": numbers,
        "vector_return": ((n,), vec2),
        "start_distance": ((h,), wp.float32),
        "distance": ((h, length), wp.float32),
        "onset": steps,
    }
    further: dict[str, tuple[tuple[int, ...], Any]] = {
        **{"go": steps, "jump": steps, "goal_target": vectors, "jump_target": vectors},
        **{"force": vectors, "offset": vectors, "pulse": vectors, "pulse_window": ((h,), steps2)},
        **{"velocity_gain": matrices, "position_gain": matrices},
        **{"stiffness": numbers, "damping": numbers, "rest": ((n,), vec2)},
    }
    shapes |= {name: further[name] for name in state_names(features) if name in further}
    named = {name: wp.zeros(shape, dtype=dtype, device=device) for name, (shape, dtype) in shapes.items()}
    named.setdefault("force", named["load"])
    named["clock"].fill_(length)
    arrays = BatchArrays(TrialArrays(), TimelineArrays(), ForceArrays(), named)
    for name, array in named.items():
        of_forces = OF_FORCES + OF_SPRING
        part = arrays.timelines if name in OF_TIMELINE else arrays.forces if name in of_forces else arrays.trials
        setattr(part, name, array)
    arrays.trials.muscle_delay, arrays.trials.hand_delay = map(wp.int32, settings.delays)
    arrays.forces.of_distance = wp.bool(settings.two_arms.spring.kind == "distance")
    arrays.forces.shoulder_distance = wp.float32(settings.two_arms.shoulder_distance)
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
    if trials.spring is not None:
        given |= {name: (values, wp.float32) for name, values in trials.spring._asdict().items()}
    rows = TrialRows()
    for name, (values, dtype) in given.items():
        setattr(rows, name, wp.array(values, dtype=dtype, device=device))
    return rows
