"""Every hemispheric algorithm takes somebody's own Gymnasium environment."""

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import spaces
from hemispheric_models import ALGORITHMS, make_model
from pendulum import make_pendulum, reward_pairs
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy

from bilateral_rl.algorithms import HemisphericPPO, HemisphericSAC, HemisphericTD3
from bilateral_rl.envs import VectorReward, VecVectorReward

pytestmark = pytest.mark.filterwarnings("ignore:You have specified a mini-batch size")
EACH_ALGORITHM = pytest.mark.parametrize("algorithm", ALGORITHMS)


@EACH_ALGORITHM
def test_it_learns_on_a_pendulum_from_both_streams(algorithm, tmp_path):
    model = make_model(algorithm, env=make_vec_env(make_pendulum, 2, env_kwargs={"max_episode_steps": 20}))
    before = {name: value.clone() for name, value in model.policy.motor_network.state_dict().items()}
    model.learn(120)
    after = model.policy.motor_network.state_dict()
    assert all(not torch.equal(after[name], value) and after[name].isfinite().all() for name, value in before.items())
    (episode, *_) = model.ep_info_buffer
    assert episode["r"] == pytest.approx((episode["dominant"] + episode["non_dominant"]) / 2, abs=0.01)
    model.save(tmp_path / "model")
    loaded = algorithm.load(tmp_path / "model", device="cpu")
    observations = np.random.default_rng(0).uniform(-1, 1, (20, 3)).astype(np.float32)
    actions, _ = model.predict(observations, deterministic=True)
    assert actions.shape == (20, 1)
    assert (np.abs(actions) <= 2).all()
    np.testing.assert_array_equal(loaded.predict(observations, deterministic=True)[0], actions)


@pytest.mark.parametrize("algorithm", [HemisphericPPO, HemisphericSAC])
def test_it_learns_the_same_from_pairs_that_are_computed_for_all_pendulums_at_once(algorithm):
    one_by_one = make_vec_env(make_pendulum, 2, seed=0, env_kwargs={"max_episode_steps": 20})
    at_once = VecVectorReward(
        make_vec_env("Pendulum-v1", 2, seed=0, env_kwargs={"max_episode_steps": 20}), reward_pairs
    )
    models = [make_model(algorithm, env=env).learn(120) for env in (one_by_one, at_once)]
    states = [model.policy.motor_network.state_dict() for model in models]
    fresh = make_model(algorithm, env=at_once).policy.motor_network.state_dict()
    for name, value in states[0].items():
        assert not torch.equal(value, fresh[name])
        torch.testing.assert_close(states[1][name], value, rtol=1e-3, atol=1e-4)
    episodes = [list(model.ep_info_buffer) for model in models]
    assert len(episodes[0]) == len(episodes[1]) >= 4
    for mine, theirs in zip(*episodes, strict=True):
        assert mine["dominant"] == pytest.approx(theirs["dominant"], rel=1e-4)


class Anything(gymnasium.Env):
    """Episodes of seven steps of random observations; refuses actions that are not of its space."""

    def __init__(self, observation_space, action_space):
        self.observation_space, self.action_space = observation_space, action_space
        self.received = []

    def reset(self, *, seed=None, options=None):
        self.steps = 0
        self.observation_space.seed(seed)
        return self.observation_space.sample(), {}

    def step(self, action):
        assert self.action_space.contains(action)
        self.received.append(np.array(action))
        self.steps += 1
        return self.observation_space.sample(), 0.0, False, self.steps == 7, {}


def sums(transition):
    return -float(np.square(transition.action).sum()), -float(np.abs(transition.action).sum())


ASYMMETRIC = spaces.Box(np.array([-3, 0.5], np.float32), np.array([-1, 7], np.float32))
BOXES = {
    "unbounded to asymmetric": (spaces.Box(-np.inf, np.inf, (4,)), ASYMMETRIC),
    "float64": (spaces.Box(-1, 1, (4,), np.float64), spaces.Box(-2, 5, (3,), np.float64)),
    "two-dimensional": (spaces.Box(-1, 1, (3, 4)), spaces.Box(-2, 5, (2, 3))),
    "integers to one": (spaces.Box(0, 9, (5,), np.int64), spaces.Box(0, 1, (1,))),
    "image to asymmetric": (spaces.Box(0, 255, (36, 36, 1), np.uint8), ASYMMETRIC),
}
"""Observations and actions."""


@pytest.mark.parametrize("algorithm", [HemisphericPPO, HemisphericSAC, HemisphericTD3])  # A2C's policy is PPO's
@pytest.mark.parametrize(("observations", "actions"), BOXES.values(), ids=BOXES)
def test_any_box_of_observations_and_of_actions(algorithm, observations, actions):
    env = Anything(observations, actions)
    model = make_model(algorithm, env=VectorReward(env, sums)).learn(40)
    received = np.stack(env.received)
    width = actions.high - actions.low
    assert (np.ptp(received, axis=0) > 0.5 * width).all(), "the whole box is explored"
    observation = observations.sample()
    action, _ = model.predict(observation, deterministic=True)
    assert actions.contains(action)
    features = model.policy.obs_to_tensor(observation)[0]
    features = features.float().flatten(1) / (255 if observations.dtype == np.uint8 else 1)
    with torch.no_grad():
        excitation = model.policy.motor_network.excitation(features).numpy().reshape(actions.shape)
    np.testing.assert_allclose(action, actions.low + width * excitation, rtol=1e-4, atol=1e-5)


@EACH_ALGORITHM
def test_actions_that_are_no_bounded_box_are_refused(algorithm):
    for actions in (spaces.Discrete(3), spaces.Box(-1, np.inf, (2,))):
        with pytest.raises((ValueError, AssertionError), match=r"[Bb]ox|bound"):
            make_model(algorithm, env=VectorReward(Anything(spaces.Box(-1, 1, (4,)), actions), sums))


@pytest.mark.slow
def test_sac_with_specialized_hemispheres_solves_the_pendulum():
    """Random actions get -1,200, a good controller -150; hanging still from the start, -1,500."""
    model = HemisphericSAC(
        "CallosalPolicy",
        make_vec_env(make_pendulum, 4, seed=0),
        weight_penalty=0.0,
        learning_rate=3e-3,
        learning_starts=1000,
        gradient_steps=2,
        gamma=0.98,
        tau=0.01,
        policy_kwargs={"units": 32},
        seed=0,
        device="cpu",
    )
    model.learn(8000)
    mean, _ = evaluate_policy(model, make_vec_env("Pendulum-v1", 10, seed=1), n_eval_episodes=20)
    assert mean > -300
