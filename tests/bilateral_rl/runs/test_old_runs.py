"""A run of version 0.1.0 is still good for everything but going on exactly."""

import json
import shutil
from pathlib import Path

import pytest

from bilateral_rl.runs.folder import RunFolder

DATA = Path(__file__).parents[2] / "data" / "run_0_1_0_ppo"
MEASURES = {
    "goal_completion_percent": 9.375,
    "time_in_goal_steps": 0.84375,
    "final_error_cm": 38.29039150150493,
    "return_dominant": -235.84991455078125,
    "return_non_dominant": -60.66679000854492,
}
"""What version 0.1.0 said of it: ``evaluate --trials 64``, at 5 cm."""


@pytest.fixture
def old(call):
    """A copy of it in the folder of the call."""
    return RunFolder(Path(shutil.copytree(DATA, "old")))


def test_it_is_evaluated_to_the_same_measures(call, old):
    code, _, err = call("evaluate", old.path, "--trials", 64, "--json", "measures.json")
    assert code == 0, err
    measures = json.loads(Path("measures.json").read_text())["by_threshold_m"]["0.05"]
    assert {name: measures[name] for name in MEASURES} == pytest.approx(MEASURES, rel=1e-3)


def test_it_is_lesioned(call, old):
    code, _, err = call("lesion", old.path, "--lesion", "shallow_dominant", "--no-retrain", "--trials", 8)
    assert code == 0, err


def test_a_new_training_begins_with_its_network(call, old):
    small = ["--units", 4, "--n-envs", 4, "--timesteps", 200, "--set", "evaluation.trials=4"]
    code, _, err = call("train", "--init-from", old.path, "--out", "new", *small)
    assert code == 0, err


def test_it_is_not_resumed_but_says_what_to_do(call, old):
    before = {path: path.read_bytes() for path in old.path.rglob("*") if path.is_file()}
    code, out, err = call("train", "--resume", old.path, "--timesteps", 2_000)
    assert (code, out) == (2, "")
    assert "0.1.0" in err
    assert "--init-from old" in err
    assert {path: path.read_bytes() for path in old.path.rglob("*") if path.is_file()} == before
