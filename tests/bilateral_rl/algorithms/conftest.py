"""Small models, and what they do in one rollout and one update."""

import numpy as np
import pytest
from stable_baselines3.common.logger import KVWriter, Logger
from stable_baselines3.common.vec_env import VecEnvWrapper

from bilateral_rl.algorithms import HemisphericPPO
from bilateral_rl.envs import ArmVecEnv

N_ENVS, N_STEPS = 4, 20


def _make_model(policy="CallosalPolicy", env=None, **kwargs):
    """A seeded model on four arms whose trials of seven steps end in the middle of its rollouts of twenty."""
    settings = {"n_steps": N_STEPS, "batch_size": 40, "n_epochs": 2, "seed": 0, "device": "cpu"}
    return HemisphericPPO(policy, env or ArmVecEnv(N_ENVS, trial_length=7), **(settings | kwargs))


def _collect(model):
    """One rollout, without the update."""
    _, callback = model._setup_learn(model.n_steps * model.n_envs, None)
    assert model.collect_rollouts(model.env, callback, model.rollout_buffer, model.n_steps)
    return model


def _gradients_of_update(model):
    """The gradients, by parameter name, that reach the optimizer in the first minibatch of ``train()``."""
    captured = {}

    def capture(*_, **__):
        for name, parameter in model.policy.named_parameters():
            captured.setdefault(name, None if parameter.grad is None else parameter.grad.clone())

    model.policy.optimizer.step = capture
    try:
        model.train()
    finally:
        del model.policy.optimizer.step
    return captured


class _Capture(KVWriter):
    """Every value that was logged, by name."""

    def __init__(self):
        self.values = {}

    def write(self, key_values, key_excluded, step=0):
        for key, value in key_values.items():
            self.values.setdefault(key, []).append(value)

    def close(self):
        pass


def _learn_logged(model, n_updates=3):
    """What a model logs while it learns, every value by name."""
    capture = _Capture()
    model.set_logger(Logger(folder=None, output_formats=[capture]))
    # SB3 writes an update's numbers with the next rollout's.
    model.learn(n_updates * model.n_steps * model.n_envs)
    return capture.values


class _EqualStreams(VecEnvWrapper):
    """Gives both streams the mean of the two rewards."""

    def reset(self):
        return self.venv.reset()

    def step_wait(self):
        return self.venv.step_wait()

    @property
    def last_vector_reward(self):
        return np.repeat(self.venv.last_vector_reward.mean(axis=1, keepdims=True), 2, axis=1)


class _Recorder(VecEnvWrapper):
    """Keeps what every step returned."""

    def __init__(self, venv):
        super().__init__(venv)
        self.steps = []

    def reset(self):
        return self.venv.reset()

    def step_wait(self):
        observations, rewards, dones, infos = self.venv.step_wait()
        pair = getattr(self.venv, "last_vector_reward", None)
        if pair is None:
            pair = np.stack([info["vector_reward"] for info in infos])
        self.steps.append((observations.copy(), pair.copy(), dones.copy(), infos))
        return observations, rewards, dones, infos


@pytest.fixture
def make_model():
    """Builder of a small model."""
    return _make_model


@pytest.fixture
def collect():
    """Collects one rollout."""
    return _collect


@pytest.fixture
def gradients_of_update():
    """Gradients of a model's first minibatch."""
    return _gradients_of_update


@pytest.fixture
def equal_streams():
    """Wrapper that makes both streams' rewards the same."""
    return _EqualStreams


@pytest.fixture
def recorder():
    """Wrapper that keeps what every step returned."""
    return _Recorder


@pytest.fixture
def learn_logged():
    """Learns a little and gives what was logged."""
    return _learn_logged
