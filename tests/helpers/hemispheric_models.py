"""Small hemispheric models for tests, and what they do in one rollout and one update."""

import gymnasium
import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import A2C, PPO, SAC, TD3
from stable_baselines3.common.logger import KVWriter, Logger
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.type_aliases import TrainFreq, TrainFrequencyUnit
from stable_baselines3.common.vec_env import VecEnvWrapper

from bilateral_rl.algorithms import HemisphericA2C, HemisphericPPO, HemisphericSAC, HemisphericTD3
from bilateral_rl.envs import ArmVecEnv

ON_POLICY = (HemisphericPPO, HemisphericA2C)
OFF_POLICY = (HemisphericSAC, HemisphericTD3)
ALGORITHMS = ON_POLICY + OFF_POLICY
STOCK = {HemisphericPPO: PPO, HemisphericA2C: A2C, HemisphericSAC: SAC, HemisphericTD3: TD3}
MIX = {
    "combined": [[0.5, 0.5]],
    "dominant": [[1.0, 0.0]],
    "non_dominant": [[0.0, 1.0]],
    "specialized": [[1.0, 0.0], [0.0, 1.0]],
}
"""Each stream's weights of the two rewards."""
PENALTY_ON_GROUP = {
    "combined": {"dominant": 1.0, "non_dominant": 1.0, "shared": 1.0},
    "dominant": {"dominant": 0.0, "non_dominant": 0.0, "shared": 0.0},
    "non_dominant": {"dominant": 2.0, "non_dominant": 2.0, "shared": 2.0},
    "specialized": {"dominant": 0.0, "non_dominant": 2.0, "shared": 1.0},
}
"""How often the weight penalty counts in what moves each group, by loss.

Paper section 4: it weighs 0 in the dominant, 2 in the non-dominant, 1 in the combined loss; a specialized model routes
it like the rest.
"""

N_ENVS, N_STEPS = 4, 20
ROLLOUT = N_ENVS * N_STEPS
"""Steps of a rollout of :func:`make_model`'s."""
_REPLAY = {"buffer_size": 2_000, "learning_starts": 40, "batch_size": 40, "train_freq": 4}
SIZES = {
    HemisphericPPO: {"n_steps": N_STEPS, "batch_size": 40, "n_epochs": 2},
    HemisphericA2C: {"n_steps": N_STEPS},
    HemisphericSAC: _REPLAY,
    HemisphericTD3: _REPLAY | {"policy_delay": 1},
}
WHOLE_ROLLOUT = {
    HemisphericPPO: {"batch_size": ROLLOUT, "n_epochs": 1, "max_grad_norm": 1e9},
    HemisphericA2C: {"max_grad_norm": 1e9},
    HemisphericSAC: {},
    HemisphericTD3: {},
}
"""Settings with which an update is one step along gradients that nothing has clipped."""


def arm(n_envs=N_ENVS):
    """Arms whose trials of seven steps end in the middle of a rollout."""
    return ArmVecEnv(n_envs, trial_length=7)


def make_model(algorithm, policy="CallosalPolicy", env=None, **kwargs):
    """A seeded model, by default on four arms. A stock algorithm gets the sizes of its hemispheric one."""
    sizes = next(sizes for ours, sizes in SIZES.items() if algorithm in (ours, STOCK[ours]))
    return algorithm(policy, env or arm(), **({"seed": 0, "device": "cpu"} | sizes | kwargs))


def collect(model):
    """Twenty steps of every environment into the rollout or the replay buffer, without an update."""
    _, callback = model._setup_learn(ROLLOUT, None)
    if isinstance(model, ON_POLICY):
        assert model.collect_rollouts(model.env, callback, model.rollout_buffer, model.n_steps)
    else:
        steps = TrainFreq(N_STEPS, TrainFrequencyUnit.STEP)
        assert model.collect_rollouts(model.env, callback, steps, model.replay_buffer).continue_training
    return model


def named_parameters(model):
    """Every parameter that any algorithm trains, by name; targets left out."""
    parameters = {name: p for name, p in model.policy.named_parameters() if "_target" not in name}
    temperature = getattr(model, "log_ent_coef", None)
    return parameters if temperature is None else parameters | {"log_ent_coef": temperature}


def optimizers(model):
    """All optimizers of a model, ours or stock."""
    if isinstance(model, (PPO, A2C)):
        return [model.policy.optimizer]
    temperature = getattr(model, "ent_coef_optimizer", None)
    return [model.policy.actor.optimizer, model.policy.critic.optimizer, *([temperature] if temperature else [])]


def update(model):
    """``train()`` with one minibatch of a replay buffer, or whatever it takes of a rollout."""
    model.train(*([1, model.batch_size] if hasattr(model, "replay_buffer") else []))
    return model


def gradients_of_update(model):
    """The gradients, by parameter name, that reach each optimizer first in an update; weights stay as they are."""
    names, captured = {id(p): name for name, p in named_parameters(model).items()}, {}

    def capturing(optimizer):
        def capture(*_, **__):
            for parameter in (p for group in optimizer.param_groups for p in group["params"]):
                gradient = None if parameter.grad is None else parameter.grad.clone()
                captured.setdefault(names[id(parameter)], gradient)

        return capture

    for optimizer in optimizers(model):
        optimizer.step = capturing(optimizer)
    try:
        update(model)
    finally:
        for optimizer in optimizers(model):
            del optimizer.step
    return captured


def weights(model):
    """A copy of all weights, targets and temperature included."""
    state = {name: value.clone() for name, value in model.policy.state_dict().items()}
    temperature = getattr(model, "log_ent_coef", None)
    return state if temperature is None else state | {"log_ent_coef": temperature.detach().clone()}


def changed(model, before):
    """Names of the weights that are no longer what :func:`weights` gave before."""
    return {name for name, value in weights(model).items() if not torch.equal(value, before[name])}


def assert_same_weights(a, b):
    """The same state of two modules, bit for bit."""
    assert a.state_dict().keys() == b.state_dict().keys()
    for name, value in a.state_dict().items():
        assert torch.equal(value, b.state_dict()[name]), name


def names_by_group(model):
    """The names of the parameters of each group."""
    names = {id(p): name for name, p in named_parameters(model).items()}
    return {group: [names[id(p)] for p in owned] for group, owned in model.parameter_groups().items()}


def assert_close_weights(ours, stock, atol=1e-6):
    """Every weight of the stock model is ours too; ours may have more."""
    mine = weights(ours)
    for name, value in weights(stock).items():
        tolerance = {"rtol": 1e-5, "atol": atol}
        torch.testing.assert_close(mine[name], value, **tolerance, msg=lambda text, name=name: f"{name}: {text}")


class _Capture(KVWriter):
    """Every value that was logged, by name."""

    def __init__(self):
        self.values = {}

    def write(self, key_values, key_excluded, step=0):
        for key, value in key_values.items():
            self.values.setdefault(key, []).append(value)

    def close(self):
        pass


def learn_logged(model, timesteps=3 * ROLLOUT):
    """Let a model learn; return every value that it logs, by name. On-policy, an update is logged with the next."""
    capture = _Capture()
    model.set_logger(Logger(folder=None, output_formats=[capture]))
    model.learn(timesteps, log_interval=1 if isinstance(model, ON_POLICY) else N_ENVS)
    return capture.values


class EqualStreams(VecEnvWrapper):
    """Gives both streams the mean of the two rewards."""

    def reset(self):
        return self.venv.reset()

    def step_wait(self):
        return self.venv.step_wait()

    @property
    def last_vector_reward(self):
        return np.repeat(self.venv.last_vector_reward.mean(axis=1, keepdims=True), 2, axis=1)


class Recorder(VecEnvWrapper):
    """Keeps what every reset and step returned."""

    def __init__(self, venv):
        super().__init__(venv)
        self.starts, self.actions, self.steps = [], [], []

    def reset(self):
        self.starts.append(self.venv.reset())
        return self.starts[-1].copy()

    def step_async(self, actions):
        self.actions.append(actions.copy())
        self.venv.step_async(actions)

    def step_wait(self):
        observations, rewards, dones, infos = self.venv.step_wait()
        pair = getattr(self.venv, "last_vector_reward", None)
        if pair is None:
            pair = np.stack([info["vector_reward"] for info in infos])
        self.steps.append((observations.copy(), pair.copy(), dones.copy(), infos))
        return observations, rewards, dones, infos


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


class TwoArms(gymnasium.Env):
    """Each half of the observation is to be met by its half of the action, at a reward for each hemisphere."""

    n_arms = 2
    observation_space = spaces.Box(-1.0, 1.0, (8,))
    action_space = spaces.Box(-1.0, 1.0, (4,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self._steps = 0
        return self._observe(), {}

    def step(self, action):
        error = np.abs(self._seen.reshape(2, 4)[:, :2].ravel() - action)
        pair = np.array([-error.mean(), -np.square(error).mean()], dtype=np.float32)
        self._steps += 1
        return self._observe(), float(pair.mean()), False, self._steps == 7, {"vector_reward": pair}

    def _observe(self):
        self._seen = self.np_random.uniform(-1, 1, 8).astype(np.float32)
        return self._seen


class LearnedFeatures(BaseFeaturesExtractor):
    """A features extractor that has parameters and statistics of its own."""

    def __init__(self, observation_space):
        super().__init__(observation_space, features_dim=9)
        self.linear = torch.nn.Linear(observation_space.shape[0], 9)
        self.norm = torch.nn.BatchNorm1d(9)

    def forward(self, obs):
        return self.norm(self.linear(obs))
