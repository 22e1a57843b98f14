"""Rewards by weights of one's own, against the terms' definitions."""

import numpy as np
import pytest

from bilateral_rl.envs import ArmEnv, ArmParameters
from bilateral_rl.envs.arm.physics import FORCE
from bilateral_rl.envs.losses import FURTHER_TERMS, PAPER_TERMS, LossSettings, SideLoss

STEPS = 6


def trial(losses, seed=0, task="hold_position"):
    """Vector rewards (STEPS, 2) of a trial, and the six terms (STEPS, 6) of its steps, from the arm's state.

    A side has the weights that are given for it, and no others.
    """
    losses = {name: SideLoss(**value) if isinstance(value, dict) else value for name, value in losses.items()}
    env = ArmEnv(task, trial_length=STEPS, losses=losses)
    env.reset(seed=seed)
    batch, previous = env.batch, None
    rewards, terms = [], []
    for action in np.random.default_rng(1).uniform(-1, 1, (STEPS, 6)):
        rewards.append(env.step(action)[4]["vector_reward"])
        u = (action + 1) / 2
        error = batch.hand[0].astype(float) - batch.target[0]
        (a, b, va, vb), (upper, fore) = batch.joint[0].astype(float), ArmParameters().link_length
        x, y = -fore * np.sin(a + b) * (va + vb), fore * np.cos(a + b) * (va + vb)
        speed = (x - upper * np.sin(a) * va) ** 2 + (y + upper * np.cos(a) * va) ** 2
        change = 0.0 if previous is None else np.square(u - previous).mean()
        force = np.square(batch.muscle[0, FORCE] / np.array(ArmParameters().max_isometric_force)).mean()
        terms.append(
            [np.abs(error).mean(), 10 * np.square(error).mean(), np.square(u).mean(), speed, change, force]
        )  # fmt: skip
        previous = u
    return np.array(rewards, dtype=float), np.array(terms)


@pytest.mark.parametrize("name", [*PAPER_TERMS, *FURTHER_TERMS])
def test_each_term_is_what_its_setting_says_and_its_weight_scales_it(name):
    one, terms = trial({"dominant": {name: 1.0}, "non_dominant": {name: 3.0}})
    expected = -terms[:, (*PAPER_TERMS, *FURTHER_TERMS).index(name)]
    assert np.abs(expected).max() > 0
    np.testing.assert_allclose(one, np.stack([expected, 3 * expected], axis=1), rtol=1e-4, atol=1e-9)


def test_terms_add_up_and_a_side_pays_its_own():
    weights = {"cartesian_1": 1.0, "activation": 0.5, "hand_speed": 0.2, "excitation_change": 2.0, "muscle_force": 4.0}
    rewards, terms = trial({"dominant": weights, "non_dominant": {"hand_speed": 1.0}})
    np.testing.assert_allclose(rewards[:, 0], -terms @ [1.0, 0, 0.5, 0.2, 2.0, 4.0], rtol=1e-4)
    np.testing.assert_allclose(rewards[:, 1], -terms[:, 3], rtol=1e-4)


def test_last_steps_leave_error_and_speed_out_until_then():
    weights = {"cartesian_1": 1.0, "cartesian_2": 1.0, "activation": 0.5, "hand_speed": 0.2, "muscle_force": 4.0}
    losses = {"dominant": weights, "non_dominant": {"cartesian_2": 1.0}}
    (always, _), (late, terms) = trial(losses), trial(losses | {"last_steps": 2})
    np.testing.assert_array_equal(late[-2:], always[-2:])
    np.testing.assert_array_equal(late[:-2, 1], 0)
    np.testing.assert_allclose(late[:-2, 0], -terms[:-2] @ [0, 0, 0.5, 0, 0, 4.0], rtol=1e-4)
    np.testing.assert_array_equal(trial(losses | {"last_steps": STEPS})[0], always)
    with pytest.raises(ValueError, match=f"last_steps must be at most trial_length, {STEPS}, got {STEPS + 1}"):
        trial(losses | {"last_steps": STEPS + 1})


def test_a_command_changes_by_nothing_in_the_first_step_of_every_trial():
    env = ArmEnv(trial_length=3, losses={"dominant": SideLoss(excitation_change=1.0)})
    for _ in range(2):
        env.reset(seed=0)
        rewards = [env.step(np.full(6, value))[4]["vector_reward"][0] for value in (1.0, 1.0, -1.0)]
        np.testing.assert_allclose(rewards, [0, 0, -1])


def test_weights_by_name_go_over_the_papers():
    paper, changed = LossSettings(), LossSettings(dominant={"hand_speed": 0.5, "activation": 0})
    assert changed.dominant == SideLoss(cartesian_2=5.0, hand_speed=0.5)
    assert changed.non_dominant == paper.non_dominant
    assert LossSettings(non_dominant={}) == paper
