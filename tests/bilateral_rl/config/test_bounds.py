"""What a configuration comes to: use is far within the bounds, and what would fill the memory is refused."""

import re

import pytest

from bilateral_rl.analysis.metrics import find_metric, metrics_of
from bilateral_rl.config.catalogue import ALGORITHMS
from bilateral_rl.config.resolve import resolve
from bilateral_rl.io.errors import UserError

LARGE = {
    "network": {"units": 1_000, "layers": 4},
    "trial": {
        "trial_length": 500,
        "feedback_delay": 20,
        "sensory_noise": 0.01,
        "max_load": 1000.0,
        "load": "direction",
    },
}


def test_what_a_large_laboratory_might_do_is_allowed():
    for algo in ALGORITHMS:
        of_rl = {"n_envs": 10_000, "evaluation": {"trials": 10_000}, "network": {"critic_arch": [1_000, 1_000]}}
        own = {
            "ppo": {"n_envs": 10_000, "ppo": {"n_steps": 500}},
            "a2c": of_rl,
            "sac": of_rl | {"sac": {"buffer_size": 5_000_000}},
            "td3": of_rl | {"td3": {"buffer_size": 5_000_000}},
            "bptt": {"seeds": 20, "bptt": {"trials": 64_000}},
        }
        if algo == "bptt":
            own["bptt"]["network"] = {"units": 100}
        assert resolve(algo, None, [LARGE, own[algo]]).algo == algo


def test_what_would_fill_the_memory_is_refused_by_its_name():
    for algo, values, name in (
        ("ppo", {"trial": {"trial_length": 20_000}}, "trial.trial_length"),
        ("ppo", {"trial": {"feedback_delay": 20_000}}, "trial.feedback_delay"),
        ("ppo", {"network": {"layers": 200}}, "network.layers"),
        ("ppo", {"network": {"units": 10_000}}, "parameters of the network"),
        ("ppo", {"network": {"critic_arch": [10_000, 10_000]}}, "parameters of a critic"),
        ("ppo", {"network": {"critic_arch": [1] * 101}}, "network.critic_arch"),
        ("ppo", {"n_envs": 1_000_000}, "n_envs and trial"),
        ("ppo", {"ppo": {"n_steps": 100_000}}, "n_envs and ppo.n_steps"),
        ("a2c", {"n_envs": 1000, "a2c": {"n_steps": 100_000}}, "n_envs and a2c.n_steps"),
        ("ppo", {"evaluation": {"trials": 1_000_000}}, "evaluation.trials and trial"),
        ("ppo", {"threads": 10**6}, "threads"),
        ("bptt", {"threads": 10**4}, "threads"),
        ("sac", {"sac": {"buffer_size": 10**9}}, "sac.buffer_size"),
        ("sac", {"sac": {"buffer_size": None}, "timesteps": 10**8}, "sac.buffer_size null, which keeps all timesteps"),
        ("bptt", {"seeds": 1000, "bptt": {"batch_size": 6400}}, "bptt.batch_size, seeds, trial and network"),
        ("bptt", {"seeds": 1000, "bptt": {"validation_trials": 10_000}}, "bptt.validation_trials, seeds"),
        ("bptt", {"seeds": 1000, "bptt": {"trials": 640_000}}, "bptt.trials and seeds"),
        ("bptt", {"seeds": 1000, "network": {"units": 2_000}}, "seeds and network"),
        ("ppo", {"trial": {"arm": {"timestep": 1e-300}}}, "trial.arm.timestep"),
        ("ppo", {"trial": {"max_load": 1e300}}, "trial.max_load"),
    ):
        with pytest.raises(UserError, match=name):
            resolve(algo, None, [values])


def test_every_radius_that_is_allowed_has_metrics_that_are_found_by_name():
    for threshold in (1e-9, 1e-7, 0.0005, 0.05 / 3, 0.05000001, 9.99999, 1e6):
        radius = resolve(None, None, [{"trial": {"threshold": threshold}}]).trial.threshold
        names = [metric.name for metric in metrics_of("random_reach", [0.02, 0.03, 0.05, radius])]
        assert len(set(names)) == len(names)
        assert [find_metric(name).name for name in names] == names


def whole_numbers(values, path=()):
    """Where whole numbers stand in nested settings."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from whole_numbers(value, (*path, name))
        elif type(value) is int:
            yield (*path, name)


def at(path, value):
    for name in reversed(path):
        value = {name: value}
    return value


def smallest(algo, path, arms):
    """Settings that leave room for any value of the setting at ``path``."""
    values = {"trial": {"trial_length": 1}, "network": {"units": 2, "layers": 1}}
    if algo == "bptt":
        return values | {"bptt": {"trials": 10**6} if path[-1] == "batch_size" else {"batch_size": 1}}
    kept = {"action_traces": []} | ({"n_steps": 2} if algo in ("ppo", "a2c") else {"buffer_size": 1})
    return values | {algo: kept, "n_envs": arms, "evaluation": {"trials": 1}}


def test_no_refusal_advises_what_is_refused_in_turn():
    for algo in ALGORITHMS:
        for path in whole_numbers(resolve(algo, None, model="uni_b").to_values()):
            for value, bound, arms in ((-1, "least", 2), (10**16, "most", 1)):
                base = smallest(algo, path, arms)
                with pytest.raises(
                    UserError, match=rf"^{re.escape('.'.join(path))} must be at {bound} [\d,]+, got"
                ) as error:
                    resolve(algo, None, [base, at(path, value)], model="uni_b")
                advised = int(re.search(r"at (?:least|most) ([\d,]+)", str(error.value))[1].replace(",", ""))
                if path[0] != "blocks":  # which only fields have
                    resolve(algo, None, [base, at(path, advised)], model="uni_b")
