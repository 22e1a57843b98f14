"""Models that stable-baselines3 saved, as runs: whatever algorithm trained them, and only if they are trusted."""

import copy
import pickle
import shutil
import zipfile

import hostile_files as hostile
import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3 import A2C, PPO, SAC, TD3
from stable_baselines3.common.vec_env import VecNormalize

from bilateral_rl.algorithms import HemisphericA2C, HemisphericPPO, HemisphericSAC, HemisphericTD3
from bilateral_rl.envs import ArmEnv, ArmVecEnv
from bilateral_rl.envs.losses import LossSettings
from bilateral_rl.policies import BilateralActorCriticPolicy
from bilateral_rl.policies.off_policy import BilateralTD3Policy, CallosalSACPolicy
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import load_policy

SHORT = {"n_steps": 5, "batch_size": 20}
FRESH = {"learning_starts": 0, "buffer_size": 100}
ODD = {"policy_kwargs": {"units": 14, "layers": 3, "critic_arch": (8,), "log_std_init": -1.0}}
ALGORITHMS = {
    "PPO": (PPO, "CallosalPolicy", SHORT, ("cc_ns", "ppo")),
    "A2C": (A2C, "UnilateralPolicy", ODD, ("uni_b", "a2c")),
    "SAC": (SAC, CallosalSACPolicy, FRESH, ("cc_ns", "sac")),
    "TD3": (TD3, BilateralTD3Policy, FRESH, ("bi_ns", "td3")),
    "HemisphericPPO": (HemisphericPPO, "CallosalPolicy", SHORT | ODD, ("cc_s", "ppo")),
    "HemisphericA2C": (HemisphericA2C, "BilateralPolicy", {"loss": "combined"}, ("bi_ns", "a2c")),
    "HemisphericSAC": (HemisphericSAC, "BilateralPolicy", FRESH | ODD, ("bi_s", "sac")),
    "HemisphericTD3": (HemisphericTD3, "UnilateralPolicy", FRESH | {"loss": "non_dominant"}, ("uni_ndl", "td3")),
}


@pytest.fixture(scope="module")
def observations():
    return ArmVecEnv(8, "random_reach", seed=3).reset()


def make(name, env=None, **values):
    algorithm, policy, arguments, _ = ALGORITHMS[name]
    arguments = copy.deepcopy(arguments | values)  # SB3's A2C writes its optimizer into the policy_kwargs it is given
    model = algorithm(policy, env or ArmVecEnv(4, "random_reach", seed=0), device="cpu", seed=5, **arguments)
    for parameter in model.policy.parameters():  # as if trained
        parameter.data += 0.01 * parameter.requires_grad
    return model


@pytest.fixture
def saved(tmp_path):
    make("PPO").save(tmp_path / "model")
    return tmp_path / "model.zip"


BOTH = {"units": 8, "n_arms": 2, "ipsilateral_share": 0.3}


def imported(call, tmp_path, *options, model="model.zip", task="random_reach"):
    code, out, err = call("import", tmp_path / model, "--trust-pickle", "--task", task, *options)
    assert (code, err) == (0, ""), err
    (folder,) = (tmp_path / "runs" / task).iterdir()
    assert f"evaluate runs/{task}/{folder.name}" in out
    return RunFolder(folder)


@pytest.mark.parametrize("name", ALGORITHMS)
def test_a_model_of_any_algorithm_acts_as_before(call, tmp_path, observations, name):
    model = make(name)
    model.save(tmp_path / "model")
    run = imported(call, tmp_path)
    config = run.config()
    assert (config.model, config.algo) == ALGORITHMS[name][-1]
    actions, _ = model.predict(observations, deterministic=True)
    np.testing.assert_array_equal(load_policy(run).predict(observations, deterministic=True)[0], actions)
    own = load_policy(run).state_dict()
    assert all(torch.equal(own[key], tensor) for key, tensor in model.policy.state_dict().items())


@pytest.mark.parametrize("name", ["PPO", "HemisphericTD3", "HemisphericSAC"])
def test_a_model_of_two_arms_acts_as_before_and_its_statistics_are_folded_in(call, tmp_path, name):
    env = VecNormalize(ArmVecEnv(4, "two_reaches", seed=0), clip_obs=100.0)
    arms = BOTH if name != "HemisphericTD3" else {"units": 8, "n_arms": 2}  # which is unilateral
    model = make(name, env, policy_kwargs=arms)
    env.reset()
    for _ in range(30):
        env.step(np.stack([env.action_space.sample() for _ in range(4)]))
    model.save(tmp_path / "model")
    env.save(tmp_path / "statistics.pkl")
    run = imported(call, tmp_path, "--vec-normalize", tmp_path / "statistics.pkl", task="two_reaches")
    network = load_policy(run).motor_network
    assert network.arguments == model.policy.motor_network.arguments
    seen = ArmVecEnv(8, "two_reaches", seed=3).reset()
    expected, _ = model.predict(env.normalize_obs(seen), deterministic=True)
    np.testing.assert_allclose(load_policy(run).predict(seen, deterministic=True)[0], expected, atol=1e-4)


def test_a_model_of_two_arms_is_no_run_of_one_nor_of_another_combination(call, tmp_path):
    make("PPO", ArmVecEnv(4, "two_reaches"), policy_kwargs=BOTH).save(tmp_path / "model")
    assert_refused(call, tmp_path, "commands both arms, and random_reach is for one: choose another --task")
    options = ("--set", "network.ipsilateral_share=0.2")
    assert_refused(call, tmp_path, "combination_dominant does not fit the settings", *options, task="two_reaches")
    make("PPO", ArmVecEnv(4, "two_reaches"), policy_kwargs={"units": 8, "n_arms": 1}).save(tmp_path / "model")
    assert_refused(call, tmp_path, "commands one arm, and two_reaches is for both", task="two_reaches")


def test_the_configuration_says_what_the_model_tells(call, tmp_path):
    chosen = {"gamma": 0.9, "clip_range": 0.3, "penalty_weights": (0.5, 1.0)}
    noisy = {"policy_kwargs": ODD["policy_kwargs"] | {"hidden_noise": 0.1}}
    make("HemisphericPPO", learning_rate=lambda left: 0.01 + 0.02 * left, **chosen, **noisy).save(tmp_path / "model")
    config = imported(call, tmp_path, "--set", "trial.threshold=0.02", task="hold_position").config()
    network, ppo = config.network, config.ppo
    assert (network.units, network.layers, network.critic_arch, network.log_std_init) == (14, 3, (8,), -1.0)
    assert network.hidden_noise == 0.1
    assert config.trial.losses == LossSettings(dominant={"penalty": 0.5}, non_dominant={"penalty": 1.0}), (
        "terms as in the paper"
    )
    assert (ppo.learning_rate, ppo.final_learning_rate) == pytest.approx((0.03, 0.01))
    assert (ppo.gamma, ppo.clip_range, ppo.n_steps, ppo.batch_size) == (0.9, 0.3, 5, 20)
    assert (config.task, config.seed, config.n_envs, config.trial.threshold) == ("hold_position", 5, 4, 0.02)


@pytest.mark.parametrize(("name", "given", "rates"), [
    ("A2C", {}, (1.0, None, True)),
    ("A2C", {"use_rms_prop": False}, (1.0, None, False)),
    ("HemisphericA2C", {"critic_rate_factor": 2.0, "network_epsilon": 0.1}, (2.0, 0.1, True)),
])  # fmt: skip
def test_the_configuration_has_the_rates_and_the_optimizer_of_the_model_not_our_defaults(
    call, tmp_path, name, given, rates
):
    make(name, **given).save(tmp_path / "model")
    a2c = imported(call, tmp_path).config().a2c
    assert (a2c.critic_rate_factor, a2c.network_epsilon, a2c.use_rms_prop) == rates


def test_every_command_takes_an_imported_model(call, tmp_path, saved):
    run = imported(call, tmp_path)
    assert run.status() == {"state": "imported", "timesteps": 0, "weights": "final", "imported_from": "model.zip"}
    shutil.copytree(run.path, run.path.with_name("other"))
    for arguments in (
        ("evaluate", run.path, "--trials", 4),
        ("lesion", run.path, "--trials", 4, "--no-retrain", "--lesion", "callosum"),
        ("compare", run.path, run.path.with_name("other"), "--trials", 4),
        ("train", "--init-from", run.path, "--model", "cc_s", "--timesteps", 100, "--n-envs", 20),
    ):
        code, _, err = call(*arguments)
        assert (code, err) == (0, "")
    _, out, _ = call("list")
    assert "imported" in out


def test_an_imported_model_is_not_resumed(call, tmp_path, saved):
    run = imported(call, tmp_path)
    code, _, err = call("train", "--resume", run.path, "--timesteps", 100_000)
    assert code == 2
    assert f"train --init-from {run.path}" in err


def test_nothing_is_loaded_without_trust(call, tmp_path):
    (tmp_path / "model.zip").write_bytes(hostile.sb3_saved(tmp_path / "canary"))
    before = sorted(tmp_path.rglob("*"))
    code, _, err = call("import", tmp_path / "model.zip", "--task", "random_reach")
    assert code == 2
    assert "--trust-pickle" in err
    for command in ("evaluate", "lesion", "compare", "render"):
        code, _, err = call(command, tmp_path / "model.zip")
        assert code == 2
        assert "make one of it with `bilateral-rl import`" in err
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("wrong", ["cut", "empty", "no zip", "other zip", "raises"])
def test_what_is_no_model_is_refused(call, tmp_path, saved, wrong):
    whole = saved.read_bytes()
    saved.write_bytes({"cut": whole[: len(whole) // 2], "empty": b"", "no zip": b"words"}.get(wrong, whole))
    if wrong in ("other zip", "raises"):
        with zipfile.ZipFile(saved, "w") as archive:
            archive.writestr("data", "{}")
            archive.writestr("policy.pth", b"words" if wrong == "raises" else pickle.dumps({}))
    assert_refused(call, tmp_path, "is no model saved by stable-baselines3")


def assert_refused(call, tmp_path, says, *options, task="random_reach"):
    code, out, err = call("import", tmp_path / "model.zip", "--trust-pickle", "--task", task, *options)
    assert (code, out) == (2, "")
    assert says in err
    assert err.count("\n") == 1
    assert not (tmp_path / "runs").exists()


def test_a_policy_of_another_kind_is_refused(call, tmp_path):
    PPO("MlpPolicy", ArmVecEnv(4, "random_reach"), device="cpu", **SHORT).save(tmp_path / "model")
    assert_refused(call, tmp_path, "has the policy ActorCriticPolicy")


class OtherArm(ArmEnv):
    """One that is commanded or observed in another way."""

    def __init__(self, observations=16, least=-1.0):
        super().__init__("random_reach")
        self.observation_space = spaces.Box(-5.0, 5.0, (observations,))
        self.action_space = spaces.Box(least, 1.0, (6,))


def test_who_trained_on_one_hemispheres_reward_may_say_so(call, tmp_path):
    make("A2C").save(tmp_path / "model")
    assert imported(call, tmp_path, "--set", "model=uni_dl").config().model == "uni_dl"


@pytest.mark.parametrize("other", [{"observations": 17}, {"least": 0.0}])
def test_a_policy_of_another_arm_is_refused(call, tmp_path, other):
    PPO(BilateralActorCriticPolicy, OtherArm(**other), device="cpu", n_steps=4, batch_size=4).save(tmp_path / "model")
    assert_refused(call, tmp_path, "does not act on the arm")


def test_a_loss_that_no_model_has_is_refused(call, tmp_path):
    HemisphericPPO("UnilateralPolicy", ArmVecEnv(4, "random_reach"), device="cpu", **SHORT).save(tmp_path / "model")
    assert_refused(call, tmp_path, "is unilateral, trained by specialized: there is no such model")


def test_weights_that_are_not_finite_are_refused(call, tmp_path):
    model = make("PPO")
    model.policy.log_std.data[0] = torch.nan
    model.save(tmp_path / "model")
    assert_refused(call, tmp_path, "not finite numbers in log_std")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--set", "trial.threshold=-1"], "threshold"),
        (["--set", "network.units=20"], "has parts that no run has, or not of this size"),
        (["--set", "model=cc_s"], "has parts that no run has, or not of this size"),
    ],
)
def test_settings_that_do_not_fit_are_refused(call, tmp_path, saved, options, says):
    assert_refused(call, tmp_path, says, *options)


def test_a_file_that_is_not_there_is_refused(call, tmp_path):
    assert_refused(call, tmp_path, "There is no file")


def normalized(name, tmp_path, **settings):
    """A model that was trained on normalized observations, its statistics, and both as files."""
    env = VecNormalize(ArmVecEnv(4, "random_reach", seed=0), **{"clip_obs": 100.0} | settings)
    model = make(name, env)
    model.learn(400)
    model.save(tmp_path / "model")
    env.save(tmp_path / "statistics.pkl")
    return model, env


EVERY = [*ALGORITHMS, "HemisphericSAC of standardized inputs"]


@pytest.mark.parametrize("name", EVERY)
def test_statistics_of_observations_are_folded_into_the_network_and_its_critics(call, tmp_path, observations, name):
    name, _, standardized = name.partition(" of ")
    if standardized:
        ALGORITHMS[name][2]["standardize_inputs"] = True
    try:
        model, env = normalized(name, tmp_path)
    finally:
        ALGORITHMS[name][2].pop("standardize_inputs", None)
    options = ("--set", "sac.standardize_inputs=true") if standardized else ()
    run = imported(call, tmp_path, "--vec-normalize", tmp_path / "statistics.pkl", *options)
    assert run.status()["vec_normalize"] == "statistics.pkl"
    policy, seen = load_policy(run), env.normalize_obs(observations)
    expected, _ = model.predict(seen, deterministic=True)
    np.testing.assert_allclose(policy.predict(observations, deterministic=True)[0], expected, atol=1e-4)
    with torch.no_grad():
        inputs = [torch.from_numpy(each) for each in (observations, seen)]
        if hasattr(policy, "predict_stream_values"):
            ours, theirs = (p.predict_stream_values(x) for p, x in zip((policy, model.policy), inputs, strict=True))
            torch.testing.assert_close(ours, theirs, rtol=1e-3, atol=1e-3)
        else:
            actions = torch.from_numpy(expected)
            for critics in ("critic", "critic_target"):
                ours, theirs = (
                    p.stream_values(getattr(p, critics), x, actions)
                    for p, x in zip((policy, model.policy), inputs, strict=True)
                )
                torch.testing.assert_close(ours, theirs, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("name", ["PPO", "SAC", "HemisphericPPO", "HemisphericSAC"])
def test_a_model_of_normalized_observations_is_refused_without_their_statistics(call, tmp_path, name):
    normalized(name, tmp_path)
    code, _, err = call("import", tmp_path / "model.zip", "--trust-pickle", "--task", "random_reach")
    assert code == 2
    assert "observations that VecNormalize had normalized" in err
    assert "--vec-normalize FILE" in err
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"norm_obs": False}, "was trained on observations as they are: leave --vec-normalize out"),
        ({"clip_obs": 0.5}, "clipped at 0.5, as happens in"),
    ],
)
def test_statistics_that_do_not_belong_to_the_model_or_to_any_network_are_refused(call, tmp_path, settings, reason):
    normalized("HemisphericPPO", tmp_path, **settings)
    model = ("import", tmp_path / "model.zip", "--trust-pickle", "--task", "random_reach", "--vec-normalize")
    for file, why in (("statistics.pkl", reason), ("model.zip", "holds no VecNormalize"), ("none.pkl", "Cannot read")):
        code, _, err = call(*model, tmp_path / file)
        assert code == 2
        if file == "statistics.pkl" or "norm_obs" not in settings:
            assert why in " ".join(err.split())
    assert not (tmp_path / "runs").exists()
