"""The package as it is installed."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

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
