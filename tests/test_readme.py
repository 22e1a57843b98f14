"""What the README shows works as it stands there."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from bilateral_rl.config.resolve import resolve
from bilateral_rl.training.run import train

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
SCRIPTS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


@pytest.mark.parametrize("number", range(len(SCRIPTS)))
def test_the_scripts_run(number, tmp_path):
    script = SCRIPTS[number]
    if "runs/random_reach/cc_s-bptt-1" in script:
        few = {"trials": 32, "batch_size": 16, "validation_trials": 4}
        train(resolve("bptt", None, [{"seeds": 4, "epochs": 1, "bptt": few}]), tmp_path / "runs")
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_there_are_scripts():
    assert len(SCRIPTS) >= 4


def test_every_file_that_it_links_to_exists():
    links = re.findall(r"\]\(([^)#]+)\)", README)
    missing = [link for link in links if not link.startswith("https://") and not (ROOT / link).exists()]
    assert links
    assert not missing
