"""What arms of trials sense and see, as Warp functions: rings of what was sensed, and the observation out of them."""

import warp as wp

from bilateral_rl.envs.arm.muscles import proprioception
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.trial_arrays import N_SENSED, Parameters, TrialArrays

HAND = 2 * N_MUSCLES
"""Where the own hand stands in what an arm sees."""
N_VIEW = HAND + 8
"""Numbers that each of two arms sees: its muscles, then x and y of its hand, the other's, its target, the other's."""


@wp.func
def sense(p: Parameters, s: TrialArrays, arm: int, clock: int, slot: int) -> None:
    """Write what arm ``arm`` senses after ``clock`` steps into ``slot`` of its ring."""
    sensed_now = proprioception(p, s.muscle[arm])
    row = clock % s.noise.shape[1]
    for k in range(2 * N_MUSCLES):
        s.sensed[arm, slot, k] = sensed_now[k] + s.noise[arm, row, k]
    for axis in range(2):
        s.sensed[arm, slot, 2 * N_MUSCLES + axis] = s.hand[arm][axis] + s.noise[arm, row, 2 * N_MUSCLES + axis]


@wp.func
def slot_before(s: TrialArrays, newest: int, steps: int) -> int:
    """Return the slot of the ring that was written ``steps`` before ``newest``; a remainder would take longer."""
    slot = newest - steps
    if slot < 0:
        slot += s.sensed.shape[1]
    return slot


@wp.func
def observe(s: TrialArrays, trial: int, arm: int, newest: int, first: int, targets: int) -> None:
    """Write what arm ``arm`` sees of itself, kept within its space, from the ring whose slot ``newest`` is the last.

    In the observation of its trial it begins at ``first``, and its target stands at ``targets``.
    """
    slot = slot_before(s, newest, s.muscle_delay)
    for k in range(N_SENSED):
        seen = s.sensed[arm, slot, k]
        s.observation[trial, first + k] = wp.clamp(seen, s.observation_low[first + k], s.observation_high[first + k])
    for axis in range(2):
        s.observation[trial, targets + axis] = s.target[arm][axis]


@wp.func
def see_hand(s: TrialArrays, trial: int, arm: int, newest: int, first: int) -> None:
    """Write the seen hand anew, which lags by a delay of its own."""
    slot = slot_before(s, newest, s.hand_delay)
    for k in range(2 * N_MUSCLES, N_SENSED):
        seen = s.sensed[arm, slot, k]
        s.observation[trial, first + k] = wp.clamp(seen, s.observation_low[first + k], s.observation_high[first + k])


@wp.func
def see_other_arm(s: TrialArrays, trial: int, shoulder_distance: float) -> None:
    """Show either arm the hand and the target of the other one, as that sees them, in its own frame."""
    for arm in range(2):
        for thing in range(2):  # hand, target
            at = HAND + 4 * thing
            x = s.observation[trial, (1 - arm) * N_VIEW + at]
            s.observation[trial, arm * N_VIEW + at + 2] = -x - shoulder_distance
            s.observation[trial, arm * N_VIEW + at + 3] = s.observation[trial, (1 - arm) * N_VIEW + at + 1]
