"""``import bilateral_rl`` is light, and registers whatever is imported before or after it."""

import json
import os
import subprocess
import sys

import pytest

HEAVY = {"gymnasium", "matplotlib", "numpy", "pandas", "scipy", "stable_baselines3", "torch", "warp"}
REGISTERED = """
import gymnasium
from stable_baselines3 import A2C, PPO, SAC, TD3
gymnasium.spec("bilateral_rl/RandomReach-v0"), gymnasium.spec("bilateral_rl/HoldPosition-v0")
assert all({"MlpPolicy", "UnilateralPolicy", "BilateralPolicy", "CallosalPolicy"} <= set(algorithm.policy_aliases)
           for algorithm in (A2C, PPO, SAC, TD3))
"""


def python(code, *arguments):
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, env=os.environ | {"COLUMNS": "200"}
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    return done.stdout


def imported_by(code):
    """Which of HEAVY a fresh interpreter has imported after ``code``."""
    tell = f"\nimport json, sys; print(json.dumps(sorted({HEAVY} & set(sys.modules))))"
    return json.loads(python(code + tell).splitlines()[-1])


@pytest.mark.parametrize(
    "code",
    [
        "import bilateral_rl",
        "import bilateral_rl.config.resolve, bilateral_rl.config.catalogue",
        "from bilateral_rl.config.resolve import resolve; resolve('bptt', 'hold_position'); resolve('sac', None)",
        "from bilateral_rl.envs import ArmParameters, TrialSettings; TrialSettings(threshold=0.03)",
        "import bilateral_rl.commands.app",
    ],
)
def test_nothing_numerical_is_imported_by(code):
    assert imported_by(code) == []


@pytest.mark.parametrize("arguments", [["--help"], ["train", "--help"], ["list"]])
def test_nothing_numerical_is_imported_by_the_command(tmp_path, arguments):
    run = tmp_path / "runs/random_reach/cc_s-ppo-1"
    run.mkdir(parents=True)
    (run / "config.yaml").write_text("{algo: ppo, model: cc_s, task: random_reach}")
    arguments = [*arguments, "--out", str(tmp_path / "runs")] if arguments == ["list"] else arguments
    code = f"import sys; sys.argv[1:] = {arguments}\nfrom bilateral_rl.commands.app import main\ntry: main()\n"
    assert imported_by(code + "except SystemExit as end: assert not end.code") == []


@pytest.mark.parametrize(
    "imports",
    [
        "import bilateral_rl, stable_baselines3",  # which imports gymnasium
        "import gymnasium, bilateral_rl, stable_baselines3",
        "import gymnasium, stable_baselines3, bilateral_rl",
        "from bilateral_rl.envs import ENVIRONMENT_IDS, ArmVecEnv",
        "from bilateral_rl.policies.off_policy import SAC_ALIASES",
        "import bilateral_rl, importlib.util; importlib.util.find_spec('stable_baselines3')",
    ],
)
def test_names_are_registered_in_every_order_of_imports(imports):
    assert python(f"{imports}\n{REGISTERED}") == ""


def test_gymnasium_finds_the_environments_without_an_import_by_their_module():
    python("import gymnasium; gymnasium.make('bilateral_rl:bilateral_rl/HoldPosition-v0').reset(seed=0)")


def test_libraries_keep_their_specification_and_source():
    code = "import bilateral_rl, gymnasium, inspect; gymnasium.spec('bilateral_rl/RandomReach-v0')"
    code += "; print(gymnasium.__spec__.loader.__class__.__name__)"
    assert python(f"{code}; assert 'gymnasium' in inspect.getsource(gymnasium)").strip() == "SourceFileLoader"


def test_the_package_lists_and_checks_its_names():
    import bilateral_rl
    from bilateral_rl import envs

    assert set(bilateral_rl.__all__) <= set(dir(bilateral_rl))
    assert set(envs.__all__) <= set(dir(envs))
    for module in (bilateral_rl, envs, envs.arm):
        assert all(getattr(module, name) is not None for name in module.__all__)
        with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
            module.nothing  # noqa: B018


def test_a_library_that_is_not_there_is_still_missing():
    code = "import sys; sys.path[:] = [p for p in sys.path if 'site-packages' not in p]; import bilateral_rl\n"
    python(code + "try: import gymnasium\nexcept ModuleNotFoundError: pass\nelse: raise AssertionError")
