"""Cues and jumps: which target is seen before each step, and judges it."""

import numpy as np
import pytest
from rich_tasks import Fixed

from bilateral_rl.envs import ArmEnv, ArmParameters
from bilateral_rl.envs.kinematics import hand_position
from bilateral_rl.envs.tasks import NEVER, Timeline

STEPS = 12
START, GOAL, JUMP = (0.6, 1.5), (1.0, 1.2), (0.8, 1.6)
PLACES = {name: hand_position(angles, ArmParameters()) for name, angles in (("s", START), ("g", GOAL), ("j", JUMP))}


def seen(go, jump, **settings):
    """Letters of the targets seen before every step, and the environment after the last."""
    env = ArmEnv(Fixed(START, GOAL, timeline=Timeline(go, jump, JUMP)), trial_length=STEPS, **settings)
    observation, _ = env.reset(seed=0)
    letters, hand = "", env.batch.hand[0].copy()
    action = np.linspace(-1, 0.5, 6)
    for step in range(STEPS):
        target = observation[14:]
        (letter,) = (name for name, place in PLACES.items() if np.allclose(place, target, atol=1e-6))
        letters += letter
        onset = {"s": STEPS, "g": go, "j": jump}[letter]
        assert env.batch.onset[0] == onset
        if onset == step:
            assert env.batch.start_distance[0] == pytest.approx(np.linalg.norm(hand - target), abs=1e-6)
        observation, _, _, _, info = env.step(action)
        hand = env.batch.hand[0].copy()
        error = hand.astype(float) - target
        assert info["distance"] == pytest.approx(np.linalg.norm(error), abs=1e-6)
        assert info["vector_reward"][1] == pytest.approx(-5 * np.abs(error).mean(), rel=1e-5)
    np.testing.assert_array_equal(env.batch.target[0], target)
    return letters, env


@pytest.mark.parametrize(
    ("go", "jump", "expected"),
    [
        (0, NEVER, "g" * 12),
        (3, NEVER, "sss" + "g" * 9),
        (3, 7, "sss" + "gggg" + "j" * 5),
        (0, 1, "g" + "j" * 11),
        (4, 4, "ssss" + "j" * 8),
        (0, 0, "j" * 12),
        (NEVER, NEVER, "s" * 12),
        (11, NEVER, "s" * 11 + "g"),
        (12, 12, "s" * 12),
        (2, 12, "ss" + "g" * 10),
    ],
)
def test_the_target_changes_at_the_cue_and_at_the_jump(go, jump, expected):
    assert seen(go, jump)[0] == expected


def test_the_last_info_counts_from_the_onset():
    _, env = seen(3, 7, threshold=0.5)  # everything is within it
    env.reset(seed=0)
    for _ in range(STEPS):
        info = env.step(np.zeros(6))[4]
    assert info["time_in_goal"] == STEPS - 7
    assert info["is_success"]
    assert info["speed_to_goal"] == pytest.approx(env.batch.start_distance[0])


def test_without_a_cue_success_is_to_stay():
    for threshold, success in ((0.5, True), (1e-4, False)):
        env = ArmEnv(Fixed(timeline=Timeline(NEVER, NEVER, JUMP)), trial_length=STEPS, threshold=threshold)
        env.reset(seed=0)
        for _ in range(STEPS):
            info = env.step(np.array([1.0, -1, -1, -1, -1, -1]))[4]
        assert info["is_success"] is success
        assert info["time_in_goal"] == 0
        assert np.isnan(info["speed_to_goal"])


def test_a_timeline_that_changes_nothing_is_the_paper_s_trial():
    def rewards(timeline):
        env = ArmEnv(Fixed(timeline=timeline), trial_length=STEPS)
        first = env.reset(seed=0)[0]
        return [first, *(env.step(np.full(6, 0.1 * step))[:2] for step in range(STEPS))]

    assert repr(rewards(None)) == repr(rewards(Timeline(0, NEVER, JUMP)))
