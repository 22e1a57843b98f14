"""Environments go on from a saved state as if nothing had happened."""

import numpy as np
import pytest
from rich_tasks import RICH_SETTINGS, Rich, RichPair

from bilateral_rl.envs import ArmVecEnv
from bilateral_rl.envs.generators import generator_states, set_generator_states


def make(**settings):
    return ArmVecEnv(3, seed=4, **{"trial_length": 7, **settings})


def steps(venv, n, seed):
    """What comes back from ``n`` random actions of all arms."""
    actions = (
        np.random.default_rng(seed).uniform(-1, 1, (n, venv.num_envs, *venv.action_space.shape)).astype(np.float32)
    )
    seen = []
    for action in actions:
        observation, _, dones, infos = venv.step(action)
        finals = [info["episode"]["r"] for info in infos if "episode" in info]
        seen.append([*observation.ravel(), *venv.last_vector_reward.ravel(), *dones, *finals])
    return seen


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"sensory_noise": 0.01, "motor_noise": 0.1, "feedback_delay": 3},
        {"task": "hold_position"},
        {"task": Rich()},
        {"task": Rich(), **RICH_SETTINGS},
        {"task": RichPair(), **RICH_SETTINGS},
    ],
    ids=["plain", "noisy", "hold", "rich", "rich and noisy", "two arms"],
)
def test_a_restored_environment_goes_on_to_the_same_bits(settings):
    venv = make(**settings)
    venv.reset()
    steps(venv, 10, seed=0)
    saved = {name: array.copy() for name, array in venv.state_arrays().items()}
    twin = make(**settings)
    twin.set_state_arrays(saved)
    assert steps(twin, 500, seed=1) == steps(venv, 500, seed=1)  # beyond the trials that are drawn ahead


def test_a_state_of_a_plain_task_has_the_arrays_that_it_always_had():
    venv = make()
    venv.reset()
    names = "observation reward vector_reward vector_return distance start_distance clock joint muscle hand target load"
    of_streams = "elapsed generators uniform next"
    assert set(venv.state_arrays()) == {*names.split(), "excitation", "noise", "sensed", *of_streams.split()}


def test_the_time_of_trials_goes_on():
    venv = make()
    venv.reset()
    venv.set_state_arrays(venv.state_arrays() | {"elapsed": np.array(1000.0)})
    times = [info["episode"]["t"] for _ in range(7) for info in venv.step(np.zeros((3, 6), np.float32))[3] if info]
    assert len(times) == 3
    assert all(1000 <= time < 1100 for time in times)


def test_what_no_environment_can_be_in_is_refused():
    venv = make()
    venv.reset()
    for name, change in (
        ("clock", lambda array: array + 7),
        ("clock", lambda array: array - 8),
        ("clock", lambda array: array.astype(np.int64)),
        ("hand", lambda array: array * np.nan),
        ("joint", lambda array: array[:2]),
        ("next", lambda array: array + 65),
        ("next", lambda array: array - 65),
        ("uniform", lambda array: array + 1),
        ("generators", lambda array: array * 0),
        ("generators", lambda array: array | 2),
        ("elapsed", lambda array: array - 1e9),
        ("another", lambda _: np.zeros(1)),
    ):
        arrays = {key: array.copy() for key, array in venv.state_arrays().items()}
        arrays[name] = change(arrays.get(name))
        with pytest.raises(ValueError, match=name):
            make().set_state_arrays(arrays)


def test_a_missing_array_is_refused():
    venv = make()
    venv.reset()
    arrays = venv.state_arrays()
    del arrays["sensed"]
    with pytest.raises(ValueError, match="sensed"):
        make().set_state_arrays(arrays)


def test_generators_go_on_from_any_half_used_draw():
    generator, twin = np.random.default_rng(3), np.random.default_rng(0)
    generator.integers(0, 10, dtype=np.uint32)  # leaves half of 64 bits
    set_generator_states([twin], generator_states([generator]))
    for draw in (lambda g: g.integers(0, 10, 5, dtype=np.uint32), lambda g: g.random(5), lambda g: g.normal(size=5)):
        np.testing.assert_array_equal(draw(twin), draw(generator))
