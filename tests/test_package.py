"""The package as it is installed."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def python_files(folder):
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*.py")}


def test_the_wheel_holds_every_source_file_and_the_data(tmp_path):
    pytest.importorskip("setuptools")
    source = tmp_path / "source"  # setuptools leaves a folder build, and packs what an earlier build left there
    source.mkdir()
    for name in ("bilateral_rl", "envs", "policies"):
        shutil.copytree(ROOT / name, source / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", tmp_path, source]
    subprocess.run(command, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    names = {name for name in zipfile.ZipFile(wheel).namelist() if name.startswith("bilateral_rl/")}
    expected = {f"bilateral_rl/envs/{name}" for name in python_files(ROOT / "envs")}
    expected |= {f"bilateral_rl/policies/{name}" for name in python_files(ROOT / "policies")}
    own = python_files(ROOT / "bilateral_rl")
    expected |= {f"bilateral_rl/{name}" for name in own if not name.startswith(("envs/", "policies/"))}
    data = {"config/defaults.yaml", "py.typed", "study/report.html.jinja"}
    package = ROOT / "bilateral_rl"
    data |= {path.relative_to(package).as_posix() for path in (package / "readings").rglob("*.*")}
    data |= {
        f"envs/experiments/paradigms/{path.name}" for path in (ROOT / "envs" / "experiments" / "paradigms").iterdir()
    }
    assert names == expected | {f"bilateral_rl/{name}" for name in data}
