"""What HemisphericPPO collects: rewards, values and advantages of each stream, on any kind of environment."""

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

from bilateral_rl.envs import ArmEnv, ArmVecEnv

GAMMA, LAMBDA = 0.9, 0.8
MIX = {
    "combined": [[0.5, 0.5]],
    "dominant": [[1.0, 0.0]],
    "non_dominant": [[0.0, 1.0]],
    "specialized": [[1.0, 0.0], [0.0, 1.0]],
}
ROLLOUT_ARRAYS = ("observations", "latent_actions", "log_prob", "rewards", "values", "advantages", "returns", "dones")


class RandomEnds(gymnasium.Env):
    """Random observations and reward pairs; an episode is terminated or truncated at random, also both at once."""

    observation_space = spaces.Box(-1.0, 1.0, (5,))
    action_space = spaces.Box(0.0, 3.0, (2,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self._observation(), {}

    def step(self, action):
        assert self.action_space.contains(action)
        pair = self.np_random.normal(size=2)
        terminated, truncated = (bool(self.np_random.random() < 0.15) for _ in range(2))
        return self._observation(), float(pair.mean()), terminated, truncated, {"vector_reward": pair}

    def _observation(self):
        return self.np_random.uniform(-1, 1, 5).astype(np.float32)


def brute_force_rollout(model, first, steps, loss, reward_scale):
    """(advantages, values), each number by itself from what the environment returned and the policy's critics."""

    def value(observation):
        with torch.no_grad():
            tensor = torch.from_numpy(np.asarray(observation, dtype=np.float32))[None]
            return model.policy.predict_stream_values(tensor)[0].double().numpy()

    seen = [first, *(step[0] for step in steps)]
    n_steps, n_envs = len(steps), len(first)
    values = np.array([[value(seen[t][i]) for i in range(n_envs)] for t in range(n_steps + 1)])
    advantages = np.zeros_like(values[:-1])
    for t, i in np.ndindex(n_steps, n_envs):
        for k in range(t, n_steps):
            _, pair, dones, infos = steps[k]
            after = values[k + 1, i]
            if dones[i]:
                truncated = infos[i]["TimeLimit.truncated"]
                after = value(infos[i]["terminal_observation"]) if truncated else 0.0
            reward = np.array(MIX[loss]) @ pair[i] * reward_scale
            advantages[t, i] += (GAMMA * LAMBDA) ** (k - t) * (reward + GAMMA * after - values[k, i])
            if dones[i]:
                break
    return advantages, values[:-1]


@pytest.mark.parametrize("loss", MIX)
@pytest.mark.parametrize(
    ("env", "n_steps"),
    [
        pytest.param(lambda: ArmVecEnv(4, trial_length=7), 20, id="truncated in the middle"),
        pytest.param(lambda: ArmVecEnv(4, trial_length=7), 21, id="truncated at the rollout's end"),
        pytest.param(lambda: ArmVecEnv(4, trial_length=1), 5, id="truncated at every step"),
        pytest.param(lambda: DummyVecEnv([RandomEnds] * 3), 40, id="truncated and terminated at random"),
    ],
)
def test_a_rollout_holds_the_advantages_of_a_brute_force_computation(make_model, collect, recorder, loss, env, n_steps):
    env = recorder(env())
    model = make_model(
        env=env, loss=loss, n_steps=n_steps, batch_size=n_steps, gamma=GAMMA, gae_lambda=LAMBDA, reward_scale=0.5
    )
    collect(model)
    rollout = model.rollout
    advantages, values = brute_force_rollout(model, rollout.observations[0], env.steps, loss, reward_scale=0.5)
    assert any(step[2].any() for step in env.steps)
    np.testing.assert_allclose(rollout.values, values, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(rollout.advantages, advantages, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(rollout.returns, advantages + values, rtol=1e-4, atol=1e-5)
    np.testing.assert_array_equal(rollout.dones, [step[2] for step in env.steps])
    np.testing.assert_array_equal(rollout.observations[1:], [step[0] for step in env.steps[:-1]])


def test_random_ends_cover_terminations_and_truncations(make_model, collect, recorder):
    env = recorder(DummyVecEnv([RandomEnds] * 3))
    collect(make_model(env=env, n_steps=40, batch_size=40))
    ends = {infos[i]["TimeLimit.truncated"] for _, _, dones, infos in env.steps for i in np.flatnonzero(dones)}
    assert ends == {True, False}


def test_a_second_rollout_goes_on_where_the_first_ended(make_model, collect, recorder):
    env = recorder(ArmVecEnv(4, trial_length=7))
    model = make_model(env=env)
    model.learn(160)
    np.testing.assert_array_equal(model.rollout.observations[0], env.steps[19][0])


def test_latent_actions_and_log_probs_are_the_policys(make_model, collect):
    """Stored before the squashing; their Gaussian log probability, and SB3's of the squashed action."""
    model = collect(make_model())
    rollout, policy = model.rollout, model.policy
    latent = torch.from_numpy(rollout.latent_actions.reshape(-1, 6))
    observations = torch.from_numpy(rollout.observations.reshape(-1, 16))
    log_prob = torch.from_numpy(rollout.log_prob.ravel())
    with torch.no_grad():
        mean = policy.motor_network(observations) / 2
        gaussian = torch.distributions.Normal(mean, policy.log_std.exp()).log_prob(latent).sum(dim=1)
        squashed = policy.get_distribution(observations).log_prob(torch.tanh(latent), latent)
    torch.testing.assert_close(log_prob, gaussian, rtol=1e-5, atol=1e-5)
    correction = torch.log(1 - torch.tanh(latent) ** 2 + 1e-6).sum(dim=1)
    torch.testing.assert_close(log_prob - correction, squashed, rtol=1e-5, atol=1e-5)
    standardized = ((latent - mean) / policy.log_std.detach().exp()).ravel()
    assert abs(standardized.mean().item()) < 0.2
    assert standardized.std().item() == pytest.approx(1.0, abs=0.15)


def test_ordinary_environments_give_the_rollout_of_the_batched_arm(make_model, collect):
    """DummyVecEnv of ArmEnv, whose reward pairs come by info, and ArmVecEnv, on the same seeds."""
    ordinary = DummyVecEnv([lambda: Monitor(ArmEnv(trial_length=7)) for _ in range(4)])
    rollouts = [collect(make_model(env=env)).rollout for env in (ordinary, ArmVecEnv(4, trial_length=7))]
    for name in ROLLOUT_ARRAYS:
        np.testing.assert_array_equal(*(getattr(rollout, name) for rollout in rollouts), err_msg=name)


def test_ordinary_environments_train_to_the_same_weights(make_model):
    ordinary = DummyVecEnv([lambda: Monitor(ArmEnv(trial_length=7)) for _ in range(4)])
    a, b = (make_model(env=env).learn(160).policy.state_dict() for env in (ordinary, ArmVecEnv(4, trial_length=7)))
    assert all(torch.equal(value, b[name]) for name, value in a.items())


@pytest.mark.filterwarnings("ignore:The environment is already wrapped with a `Monitor`")
@pytest.mark.parametrize(
    "env",
    [
        pytest.param(lambda: DummyVecEnv([lambda: Monitor(ArmEnv(trial_length=7))] * 4), id="DummyVecEnv"),
        pytest.param(lambda: VecMonitor(ArmVecEnv(4, trial_length=7)), id="VecMonitor"),
    ],
)
def test_the_streams_returns_are_logged_on_any_environment(make_model, learn_logged, env):
    expected = learn_logged(make_model())
    logged = learn_logged(make_model(env=env()))
    for side in ("dominant", "non_dominant"):
        np.testing.assert_allclose(logged[f"return/{side}"], expected[f"return/{side}"], rtol=1e-6)


@pytest.mark.filterwarnings("ignore:The environment is already wrapped with a `Monitor`")
@pytest.mark.parametrize(
    "wrap", [VecMonitor, lambda env: VecNormalize(env, norm_reward=False)], ids=["VecMonitor", "VecNormalize"]
)
def test_wrappers_of_sb3_pass_the_reward_pair_on(make_model, collect, recorder, wrap):
    env = recorder(ArmVecEnv(4, trial_length=7))
    model = collect(make_model(env=wrap(env), gamma=0.0))
    np.testing.assert_allclose(model.rollout.rewards, [step[1] for step in env.steps], rtol=1e-6)


def test_an_environment_without_reward_pairs_is_refused_by_name(make_model):
    with pytest.raises(ValueError, match="vector_reward"):
        make_model(env=gymnasium.make("Pendulum-v1"), batch_size=20).learn(20)
