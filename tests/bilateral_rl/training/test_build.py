"""From a configuration to an algorithm that trains, and from its run back to policies."""

import copy
import dataclasses
import itertools

import numpy as np
import pytest
import torch
from hemispheric_models import optimizers
from one_arm_tasks import ONE_ARM_TASKS
from rich_tasks import RICH_SETTINGS
from stable_baselines3.common.callbacks import BaseCallback

from bilateral_rl.algorithms import ALGORITHM_CLASSES
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.config.parse import merge
from bilateral_rl.config.resolve import check_penalty, from_values, resolve
from bilateral_rl.config.schema import CONFIGS, RLConfig
from bilateral_rl.envs import TASKS
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import initial_states, load_policies, load_policy, network_states
from bilateral_rl.training.build import build_algorithm

ON_POLICY = {"n_steps": 8}
OFF_POLICY = {"buffer_size": 200, "learning_starts": 8, "batch_size": 8, "train_freq": 4, "critic_warm_up": 0}
HYPERPARAMETERS = {
    "ppo": ON_POLICY | {"batch_size": 16, "n_epochs": 1},
    "a2c": ON_POLICY,
    "sac": OFF_POLICY,
    "td3": OFF_POLICY | {"policy_delay": 1},
}
OBSERVATION = np.random.default_rng(0).normal(size=(32, 16)).astype(np.float32)

algos = pytest.mark.parametrize("algo", ALGORITHM_CLASSES)


def small(algo, task="random_reach", model="cc_s", **values) -> RLConfig:
    sizes = {"n_envs": 4, "trial": {"trial_length": 6}, "network": {"critic_arch": [16]}, algo: HYPERPARAMETERS[algo]}
    return resolve(algo, task, [merge(sizes, values)], model=model)


def test_every_algorithm_by_reinforcement_has_a_class_and_a_configuration():
    assert {name for name, config in CONFIGS.items() if issubclass(config, RLConfig)} == set(ALGORITHM_CLASSES)


def saved(algorithm, config, out):
    folder = RunFolder.create(out, config)
    folder.save_weights("final", dict(algorithm.policy.state_dict()))
    return folder


def action_of(policy):
    return policy.predict(OBSERVATION, deterministic=True)[0]


@algos
def test_every_algorithm_trains_every_model_which_acts_from_its_run_as_it_was_trained(tmp_path, algo, same_bits):
    for (model, spec), task in zip(MODELS.items(), itertools.cycle(ONE_ARM_TASKS), strict=False):
        config = small(algo, task, model, network={"units": 8})
        algorithm = build_algorithm(config)
        assert type(algorithm) is ALGORITHM_CLASSES[algo]
        assert (algorithm.loss, algorithm.policy.motor_network.architecture) == (spec.loss, spec.architecture)
        assert type(algorithm.env.batch.task) is TASKS[task]
        before = copy.deepcopy(algorithm.policy.state_dict())
        algorithm.learn(48)
        after = algorithm.policy.state_dict()
        assert not [name for name, value in after.items() if torch.equal(value, before[name])]
        assert all(bool(value.isfinite().all()) for value in after.values())
        folder = saved(algorithm, config, tmp_path)
        np.testing.assert_array_equal(action_of(load_policy(folder)), action_of(algorithm.policy))
        ((seed, state),) = network_states(folder).items()
        assert seed == config.seed
        assert same_bits(state, dict(algorithm.policy.motor_network.state_dict()))


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA GPU")
@algos
@pytest.mark.parametrize(
    ("task", "values"),
    [
        ("random_reach", {}),
        ("random_reach", {"network": {"hidden_noise": 0.1}, "trial": RICH_SETTINGS}),
        ("reach_and_hold", {"network": {"trained_combination": True}}),
    ],
    ids=["plain", "rich", "two arms"],
)
def test_every_algorithm_trains_on_a_gpu(algo, task, values):
    algorithm = build_algorithm(small(algo, task, device="cuda", **values))
    before = copy.deepcopy(algorithm.policy.state_dict())
    algorithm.learn(48)
    after = algorithm.policy.state_dict()
    assert {value.device.type for value in after.values()} == {"cuda"}
    assert not [name for name, value in after.items() if torch.equal(value, before[name])]


# Settings

UNUSUAL = {
    "learning_rate": 0.02, "final_learning_rate": 0.01, "gamma": 0.9, "weight_penalty": 0.3, "reward_scale": 7.0,
    "n_steps": 10, "gae_lambda": 0.7, "ent_coef": 0.04, "final_ent_coef": 0.03, "vf_coef": 0.6, "max_grad_norm": 0.8,
    "batch_size": 20, "n_epochs": 3, "clip_range": 0.25, "normalize_advantage": True, "use_rms_prop": False,
    "buffer_size": 400, "learning_starts": 12, "tau": 0.02, "train_freq": 3, "gradient_steps": 2, "n_critics": 3,
    "critic_warm_up": 5, "action_traces": (0.1, 0.7), "standardize_inputs": True, "actor_value": "mean",
    "normalize_streams": True, "critic_rate_factor": 2.0, "network_epsilon": 0.01,
    "initial_ent_coef": 0.2, "target_entropy": -2.0, "action_noise": 0.15, "policy_delay": 4,
    "target_policy_noise": 0.35, "target_noise_clip": 0.45,
}  # fmt: skip


def as_built(algorithm):
    """The hyperparameters of an algorithm, by their names in configurations, where they are not attributes of it."""
    on_policy = hasattr(algorithm, "rollout_buffer")
    values = {"learning_rate": algorithm.lr_schedule(1.0), "final_learning_rate": algorithm.lr_schedule(0.0)}
    if on_policy:
        values |= {"ent_coef": algorithm.ent_coef(1.0), "final_ent_coef": algorithm.ent_coef(0.0)}
        values["use_rms_prop"] = isinstance(algorithm.policy.optimizer, torch.optim.RMSprop)
    else:
        values |= {"train_freq": algorithm.train_freq.frequency, "n_critics": algorithm.policy.n_critics}
    if hasattr(algorithm, "clip_range"):
        values["clip_range"] = algorithm.clip_range(1.0)
    if getattr(algorithm, "ent_coef_optimizer", None) is not None:
        values["initial_ent_coef"] = algorithm.log_ent_coef.exp().item()
    if getattr(algorithm, "action_noise", None) is not None:
        values["action_noise"] = algorithm.action_noise._sigma.max()
    return values


@algos
def test_every_hyperparameter_reaches_the_algorithm(algo):
    config = small(algo)
    fields = [f.name for f in dataclasses.fields(config.hyperparameters)]
    given = {name: UNUSUAL[name] for name in fields}
    if algo == "sac":
        del given["ent_coef"]  # the learned temperature; the next test gives it
    defaults = type(config.hyperparameters)()
    assert all(getattr(defaults, name) != value for name, value in given.items())
    algorithm = build_algorithm(small(algo, **{algo: given}))
    built = as_built(algorithm)
    for name, value in given.items():
        assert built.get(name, getattr(algorithm, name, None)) == pytest.approx(value), name


@algos
def test_the_losses_weights_of_the_penalty_reach_the_algorithm(algo):
    assert build_algorithm(small(algo)).penalty_weights == (0.0, 2.0)
    heavy = small(algo, trial={"losses": {"dominant": {"penalty": 0.5}}})
    assert heavy.trial.losses.dominant.cartesian_2 == 5.0, "a mapping changes the paper's loss"
    assert build_algorithm(heavy).penalty_weights == (0.5, 2.0)


def test_a_penalty_that_weighs_nothing_in_the_models_loss_is_refused_where_it_is_set(recwarn):
    by_default = small("ppo", model="uni_dl")
    assert by_default.ppo.weight_penalty > 0
    assert build_algorithm(by_default).weight_penalty == 0
    assert not [str(w.message) for w in recwarn if "weight_penalty" in str(w.message)]
    with pytest.raises(UserError, match=r"ppo\.weight_penalty has no effect on uni_dl, whose loss weighs it by 0"):
        check_penalty([{"ppo": {"weight_penalty": 0.1}}], by_default)
    heavy = {"losses": {"dominant": {"penalty": 1.0}}}
    weighed = small("ppo", model="uni_dl", ppo={"weight_penalty": 0.1}, trial=heavy)
    check_penalty([{"ppo": {"weight_penalty": 0.1}}], weighed)
    assert build_algorithm(weighed).weight_penalty == 0.1
    from_values(by_default.to_values())  # a run that says so by default is read


def test_a_loss_that_weighs_nothing_is_refused_where_a_model_learns_by_it():
    nothing = {"cartesian_2": 0.0, "activation": 0.0, "penalty": 1.0}
    without = {"losses": {"dominant": nothing}}
    for model in ("cc_s", "uni_dl"):
        with pytest.raises(UserError, match=rf"{model} learns by the dominant loss, and trial\.losses weighs none of"):
            small("ppo", model=model, trial=without)
    for model in ("uni_ndl", "bi_ns"):
        small("ppo", model=model, trial=without)


def test_a_given_temperature_reaches_sac():
    algorithm = build_algorithm(small("sac", sac={"ent_coef": 0.04}))
    assert algorithm.ent_coef_optimizer is None
    assert algorithm.ent_coef_tensor.item() == pytest.approx(0.04)


@pytest.mark.parametrize(("target", "steered_to"), [(None, -6.0), (-9.0, -9.0)])
def test_a_learned_temperature_steers_to_its_target_or_to_minus_the_number_of_muscles(target, steered_to):
    algorithm = build_algorithm(small("sac", sac={"target_entropy": target}))
    assert algorithm.target_entropy == steered_to


@algos
def test_the_networks_settings_reach_the_policy(algo):
    network = {"units": 12, "layers": 3, "critic_arch": [5, 4]} | ({} if algo == "td3" else {"log_std_init": -1.25})
    policy = build_algorithm(small(algo, network=network)).policy
    assert (policy.motor_network.units, policy.motor_network.layers) == (12, 3)
    assert policy.critic_arch == (5, 4)
    stds = [value for name, value in policy.state_dict().items() if name.endswith("log_std")]
    assert all((std == -1.25).all() for std in stds)
    assert len(stds) == (0 if algo == "td3" else 1)


def test_a_minibatch_of_ppo_splits_a_rollout_evenly_without_a_warning(recwarn):
    for n_steps, largest, expected in ((8, 16, 16), (8, 20, 16), (8, 31, 16), (8, 32, 32), (10, 16, 14), (10, 99, 40)):
        algorithm = build_algorithm(small("ppo", ppo={"n_steps": n_steps, "batch_size": largest}))
        assert algorithm.batch_size == expected
        buffer = algorithm.rollout_buffer
        buffer.compute_returns_and_advantage(buffer.rewards, buffer.rewards[0])
        sizes = [len(batch.returns) for batch in buffer.get(algorithm.batch_size)]
        assert sizes[:-1] == [expected] * (len(sizes) - 1)
        assert sum(sizes) == 4 * n_steps
    assert not [w for w in recwarn if "mini-batch" in str(w.message)]


class Rates(BaseCallback):
    """The learning rates of every optimizer after every step."""

    def __init__(self):
        super().__init__()
        self.seen = []

    def _on_step(self):
        self.seen.append([group["lr"] for optimizer in optimizers(self.model) for group in optimizer.param_groups])
        return True


@algos
def test_every_learning_rate_falls_linearly_to_its_last_value(algo):
    config = small(algo, **{algo: {"learning_rate": 0.01, "final_learning_rate": 0.002, "critic_rate_factor": 1.0}})
    algorithm, rates = build_algorithm(config), Rates()
    algorithm.learn(160, callback=rates)
    rates.on_step()
    assert len(rates.seen[0]) == {"ppo": 1, "a2c": 1, "sac": 3, "td3": 2}[algo]
    for seen in zip(*rates.seen, strict=True):
        assert list(seen) == sorted(seen, reverse=True)
        assert len(set(seen)) >= 5
        assert (seen[0], seen[-1]) == pytest.approx((0.01, 0.002))


@algos
def test_neighboring_seeds_share_no_trial_and_the_same_seed_shares_all(algo):
    starts = [build_algorithm(small(algo, seed=seed)).env.reset() for seed in (0, 0, 1)]
    np.testing.assert_array_equal(starts[0], starts[1])
    assert not set(starts[0][:, 12].tolist()) & set(starts[2][:, 12].tolist())


# From a run on


@algos
def test_a_network_goes_on_in_any_other_algorithm(tmp_path, algo, same_bits):
    config = small(algo)
    algorithm = build_algorithm(config)
    target = {"init_from": str(saved(algorithm, config, tmp_path).path)}
    for config in (resolve("bptt", None, [target]), *(small(other, **target) for other in ALGORITHM_CLASSES)):
        (state,) = initial_states(config).values()
        assert same_bits(state, dict(algorithm.policy.motor_network.state_dict()))


@pytest.mark.parametrize(("algo", "other"), [("sac", "td3"), ("td3", "sac"), ("sac", "ppo"), ("a2c", "sac")])
def test_weights_of_another_algorithm_are_refused(tmp_path, algo, other):
    folder = saved(build_algorithm(small(algo)), small(other), tmp_path)
    with pytest.raises(UserError, match="do not fit its configuration"):
        load_policies(folder)
