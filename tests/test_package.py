"""The package as it is installed."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import bilateral_rl

ROOT = Path(__file__).parents[1]


def python_files(folder):
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*.py")}


def test_the_wheel_holds_every_source_file_and_the_data(tmp_path):
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", tmp_path, ROOT]
    pytest.importorskip("setuptools")
    subprocess.run(command, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    names = {name for name in zipfile.ZipFile(wheel).namelist() if name.startswith("bilateral_rl/")}
    expected = {f"bilateral_rl/envs/{name}" for name in python_files(ROOT / "envs")}
    expected |= {f"bilateral_rl/policies/{name}" for name in python_files(ROOT / "policies")}
    own = python_files(ROOT / "bilateral_rl")
    expected |= {f"bilateral_rl/{name}" for name in own if not name.startswith(("envs/", "policies/"))}
    data = {"config/defaults.yaml", "py.typed", "study/report.html.jinja"}
    assert names == expected | {f"bilateral_rl/{name}" for name in data}


def test_importing_the_package_registers_environments_and_policies():
    import gymnasium
    from stable_baselines3 import A2C, PPO

    assert {"bilateral_rl/RandomReach-v0", "bilateral_rl/HoldPosition-v0"} <= gymnasium.registry.keys()
    for algorithm in (PPO, A2C):
        assert {"MlpPolicy", "UnilateralPolicy", "BilateralPolicy", "CallosalPolicy"} <= algorithm.policy_aliases.keys()
    assert bilateral_rl.__version__


def test_start_up_is_silent():
    code = "import bilateral_rl; bilateral_rl.envs.ArmEnv().reset(seed=0)"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("", "")
