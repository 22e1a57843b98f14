"""Rollouts of HemisphericPPO and HemisphericA2C: rewards, values and advantages of each stream."""

import numpy as np
import pytest
import torch
from hemispheric_models import MIX, ON_POLICY, RandomEnds, Recorder, arm, collect, make_model
from stable_baselines3.common.vec_env import DummyVecEnv

from bilateral_rl.algorithms import HemisphericA2C
from bilateral_rl.envs import ArmVecEnv

GAMMA, LAMBDA = 0.9, 0.8


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


@pytest.mark.parametrize("algorithm", ON_POLICY)
@pytest.mark.parametrize(
    ("env", "n_steps", "loss"),
    [
        pytest.param(arm, 20, "specialized", id="truncated in the middle"),
        pytest.param(arm, 21, "combined", id="truncated at the rollout's end"),
        pytest.param(lambda: ArmVecEnv(4, trial_length=1), 5, "dominant", id="truncated at every step"),
        pytest.param(lambda: DummyVecEnv([RandomEnds] * 3), 40, "specialized", id="truncated and terminated at random"),
    ],
)
def test_a_rollout_holds_the_advantages_of_a_brute_force_computation(algorithm, loss, env, n_steps):
    env = Recorder(env())
    settings = {"n_steps": n_steps, "gamma": GAMMA, "gae_lambda": LAMBDA, "reward_scale": 0.5}
    settings |= {} if algorithm is HemisphericA2C else {"batch_size": n_steps}
    model = collect(make_model(algorithm, env=env, loss=loss, **settings))
    rollout = model.rollout_buffer
    advantages, values = brute_force_rollout(model, rollout.observations[0], env.steps, loss, reward_scale=0.5)
    assert any(step[2].any() for step in env.steps)
    np.testing.assert_allclose(rollout.values, values, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(rollout.advantages, advantages, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(rollout.returns, advantages + values, rtol=1e-4, atol=1e-5)
    np.testing.assert_array_equal(rollout.dones, [step[2] for step in env.steps])
    np.testing.assert_array_equal(rollout.observations[1:], [step[0] for step in env.steps[:-1]])


def test_a_second_rollout_goes_on_where_the_first_ended():
    env = Recorder(arm())
    model = make_model(HemisphericA2C, env=env).learn(160)
    np.testing.assert_array_equal(model.rollout_buffer.observations[0], env.steps[19][0])


def test_latent_actions_and_log_probs_are_the_policys():
    """Stored before the squashing; their Gaussian log probability, and SB3's of the squashed action."""
    model = collect(make_model(HemisphericA2C))
    rollout, policy = model.rollout_buffer, model.policy
    latent = torch.from_numpy(rollout.latent_actions.reshape(-1, 6))
    observations = torch.from_numpy(rollout.observations.reshape(-1, 16))
    log_prob = torch.from_numpy(rollout.log_probs.ravel())
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
