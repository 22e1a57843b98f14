"""The state of a training is all of it, and what is no such state is refused."""

import random

import numpy as np
import pytest
import torch
from rl_runs import ALGORITHMS, OF_THE_CLOCK, small_rl
from stable_baselines3.common.logger import Logger

from bilateral_rl.training.build import build_algorithm
from bilateral_rl.training.checkpoint import restore, state_tensors

STEPS = 400


def built(algo, **values):
    algorithm = build_algorithm(small_rl(algo, **values))
    algorithm.set_logger(Logger(None, []))
    return algorithm


def learned(algo, **values):
    """After some steps, with numbers in its log that are not written yet."""
    return built(algo, **values).learn(STEPS, log_interval=None)


def saved(algorithm):
    return {name: tensor.detach().clone() for name, tensor in state_tensors(algorithm).items()}


def differing(one, other):
    names = (one.keys() | other.keys()) - OF_THE_CLOCK
    return sorted(n for n in names if n not in one or n not in other or not _same(one[n], other[n]))


def _same(one, other):
    return one.dtype == other.dtype and torch.equal(torch.nan_to_num(one), torch.nan_to_num(other))


@pytest.fixture(scope="module")
def states():
    """The saved state of a training by each algorithm."""
    return {algo: saved(learned(algo)) for algo in ALGORITHMS}


def assert_goes_on_to_the_same_bits(algorithm, twin):
    """The twin, restored to the state of ``algorithm``, has that state, and both go on alike."""
    state = saved(algorithm)
    algorithm.learn(STEPS, log_interval=None, reset_num_timesteps=False)
    after = saved(algorithm)
    restore(twin, state)
    assert differing(saved(twin), state) == []
    twin.learn(STEPS, log_interval=None, reset_num_timesteps=False)
    assert differing(saved(twin), after) == []
    assert differing(state, after), "it was meant to learn"


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_a_restored_training_has_the_same_state_and_goes_on_to_the_same_bits(algo):
    values = {"model": "bi_s", "trial": {"motor_noise": 0.1, "feedback_delay": 2}}
    algorithm = learned(algo, **values)
    assert_goes_on_to_the_same_bits(algorithm, built(algo, **values, seed=5))


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_a_restored_training_goes_on_with_its_traces_in_the_middle_of_a_trial(algo):
    of_critics = {"action_traces": [0.5, 0.8]}
    if algo in ("sac", "td3"):
        of_critics |= {"standardize_inputs": True, "normalize_streams": True, "actor_value": "mean"}
        of_critics |= {"buffer_size": None}
    values = {algo: of_critics, "trial": {"trial_length": 17}}
    algorithm = built(algo, **values)
    algorithm.learn(STEPS, log_interval=None)
    state = saved(algorithm)
    assert state["environment.clock"].all()
    assert state["last.traces"].any()
    assert ("weights.stream_scale.mean_square" in state) == ("weights.policy.critic.input_mean" in state)
    assert_goes_on_to_the_same_bits(algorithm, built(algo, **values, seed=5))


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_a_restored_training_goes_on_with_its_rates_and_whatever_optimizer(algo):
    rates = {"critic_rate_factor": 3.0, "network_epsilon": 0.01}
    values = {algo: rates | ({"use_rms_prop": True} if algo == "a2c" else {})}
    assert_goes_on_to_the_same_bits(learned(algo, **values), built(algo, **values, seed=5))


@pytest.mark.parametrize("algo", ["sac", "td3"])
def test_a_buffer_of_the_whole_training_is_never_full(algo):
    algorithm = built(algo, **{algo: {"buffer_size": None, "gradient_steps": 1}})
    algorithm.learn(1_600, log_interval=None)
    buffer = algorithm.replay_buffer
    assert (buffer.full, buffer.pos, buffer.buffer_size) == (False, 200, 201)


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_every_number_that_changes_while_learning_is_in_the_state(algo, states):
    """Of the model's tensors and optimizers, the buffer, the counters and the random streams."""
    names = set(states[algo])
    algorithm = learned(algo)
    assert {f"weights.policy.{name}" for name in algorithm.policy.state_dict()} <= names
    optimizers = [value for owner in _owners(algorithm) for value in vars(owner).values() if _is_optimizer(value)]
    stepped = sum(len(optimizer.state) for optimizer in optimizers)
    assert stepped == len({name.rpartition(".")[0] for name in names if name.startswith("optimizer.")}) > 0
    assert {"counter.num_timesteps", "counter._n_updates", "counter._episode_num"} <= names
    assert {"random.torch", "random.numpy", "random.python", "random.action_space"} <= names
    assert {"last.observation", "environment.generators", "episodes.info.r", "log.train/learning_rate"} <= names
    if algo in ("sac", "td3"):
        arrays = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts", "pos", "full")
        assert {f"replay.{name}" for name in arrays} <= names
    assert ("weights.log_ent_coef" in names) == (algo == "sac")


def _owners(algorithm):
    return [algorithm, algorithm.policy, *algorithm.policy.children()]


def _is_optimizer(value):
    return isinstance(value, torch.optim.Optimizer)


def test_only_the_filled_part_of_the_replay_buffer_is_saved(states):
    algorithm = built("sac")
    assert len(algorithm.replay_buffer.observations) == 150
    assert states["sac"]["replay.rewards"].shape == (STEPS // 8, 8, 2)
    algorithm.learning_starts = 1_600
    full = saved(algorithm.learn(1_600, log_interval=None))
    assert full["replay.full"]
    assert full["replay.rewards"].shape == (150, 8, 2)


def test_what_had_no_gradient_yet_has_no_optimizer_state_after_restoring():
    algorithm = built("td3")
    algorithm.learn(8, log_interval=None)  # random actions only
    state = saved(algorithm)
    assert not any(name.startswith("optimizer.") for name in state)
    restore(twin := built("td3"), state)
    assert not twin.critic.optimizer.state
    assert all(parameter.grad is None for parameter in twin.policy.parameters())


@pytest.mark.parametrize("algo", ["ppo", "a2c", "sac"])
def test_every_tensor_is_checked(algo, states):
    """Whichever is missing, of another shape or type, or not finite, the state is refused with a sentence."""
    state, generator = states[algo], random.Random(0)
    twin = built(algo)
    changes = {
        "missing": lambda _: None,
        "reshaped": lambda t: torch.zeros((*t.shape, 2), dtype=t.dtype),
        "of another type": lambda t: t.to(torch.float64 if t.dtype != torch.float64 else torch.float32),
        "of an odd type": lambda t: torch.zeros(t.shape, dtype=torch.bfloat16),
        "not finite": lambda t: t * torch.nan if t.is_floating_point() and t.numel() else None,
    }
    optional = {"episodes.info.t", "episodes.info.dominant", "episodes.info.non_dominant"}
    for what, change in changes.items():
        for name in generator.sample(sorted(state), 12):
            if name.startswith("log.") or name in optional:
                continue
            changed = change(state[name])
            other = {n: t for n, t in state.items() if n != name} | ({} if changed is None else {name: changed})
            assert _is_refused(twin, other), f"{name}, {what}, was taken"


def _is_refused(algorithm, state):
    try:
        restore(algorithm, state)
    except ValueError as error:
        return len(str(error)) > 10
    return False


NO_TRAINING_HAS = [
    ("counter.num_timesteps", torch.tensor(-1)),
    ("replay.pos", torch.tensor(150)),
    ("replay.pos", torch.tensor(-1)),
    ("random.numpy", torch.full((625,), 700)),
    ("random.numpy", torch.full((625,), -1)),
    ("random.python", torch.full((625,), 1 << 40)),
    ("random.python_gauss", torch.zeros(2, dtype=torch.float64)),
    ("random.torch", torch.zeros(5056, dtype=torch.uint8)),
    ("random.action_space", torch.zeros(1, 6, dtype=torch.int64)),
    ("environment.clock", torch.full((8,), 20, dtype=torch.int32)),
    ("environment.clock", torch.full((8,), -1, dtype=torch.int32)),
    ("episodes.success", torch.zeros(101, dtype=torch.float64)),
    ("weights.policy.another", torch.zeros(1)),
    ("optimizer.critic.optimizer.99.exp_avg", torch.zeros(1)),
    ("optimizer.critic.optimizer.0.another", torch.zeros(1)),
    ("optimizer.critic.optimizer.0.step", torch.tensor(-1e9)),
    ("nonsense", torch.zeros(1)),
]


def test_numbers_that_no_training_has_are_refused(states):
    twin = built("sac")
    for name, value in NO_TRAINING_HAS:
        assert _is_refused(twin, states["sac"] | {name: value}), f"{name} = {value} was taken"


def test_the_random_streams_go_on(states):
    algorithm = learned("sac")
    algorithm.action_space.sample()
    torch.randn(1)
    np.random.normal()  # noqa: NPY002 - one of a pair: the other is held back
    random.gauss(0, 1)
    state = saved(algorithm)

    def draws():
        numpy = [np.random.normal(), np.random.random()]  # noqa: NPY002
        return [*numpy, random.gauss(0, 1), random.random(), float(torch.randn(1)), *algorithm.action_space.sample()]

    expected = draws()
    restore(algorithm, state)
    assert draws() == expected
