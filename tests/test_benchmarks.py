"""Scripts that no test runs, since they take minutes: all that they import is there, and what they reckon is right."""

import ast
import importlib
import math
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bilateral_rl.config.resolve import resolve
from bilateral_rl.envs.settings import TrialSettings

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
SCRIPTS = sorted(BENCHMARKS.glob("*.py"))


def imported(source):
    """Module and name of every ``from bilateral_rl… import …``, also of scripts that a script holds as text."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("bilateral_rl"):
            yield from ((node.module, alias.name) for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and "\nfrom bilateral_rl" in node.value:
            yield from imported(node.value)


def test_what_they_import_is_there():
    for script in SCRIPTS:
        for module, name in imported(script.read_text(encoding="utf-8")):
            assert hasattr(importlib.import_module(module), name), f"{script.stem}: {module} has no {name}"


# --- learning.py ------------------------------------------------------------------------------------------------------


@pytest.fixture
def script(monkeypatch):
    """Imports a script by name."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return importlib.import_module


def test_a_fall_counts_once_a_performance_was_good(script):
    measures = script("learning_measures")
    assert measures.largest_fall([10, 60, 5, 72, 69, 90, 81, 95]) == 9
    assert measures.largest_fall([10, 60, 5, 69]) == 0
    assert measures.largest_fall([]) == 0


def test_progress_is_of_completed_reaches_or_of_the_trial_s_steps_in_the_goal(script):
    progress = script("learning_measures").progress
    along = pd.DataFrame(
        {
            "timesteps": [100, 200, 300],
            "goal_completion_percent": [50.0, 91.0, 80.0],
            "time_in_goal_steps": [40.0, 36.0, 45.0],
        }
    )
    assert progress(along, "random_reach", TrialSettings()) == {"largest_fall": 11, "steps_to_90": 200}
    assert progress(along, "hold_position", TrialSettings()) == {"largest_fall": 8, "steps_to_90": 300}
    never = progress(along.iloc[:1], "random_reach", TrialSettings())["steps_to_90"]
    assert math.isnan(never)


def test_minutes_are_read_where_the_steps_were_done(script):
    minutes_at = script("learning_measures").minutes_at
    monitor = pd.DataFrame({"l": [50, 50, 50], "t": [6.0, 12.0, 60.0]})
    assert [minutes_at(monitor, steps) for steps in (50, 51, 150)] == [0.1, 0.2, 1.0]
    assert math.isnan(minutes_at(monitor, math.nan))


def test_rows_are_written_one_by_one_and_not_made_again(script, tmp_path):
    learning = script("learning")
    cases = [learning.Case("ppo", "cc_s", "random_reach", seed, variant) for seed in (0, 1) for variant in ("", "a=1")]
    file = tmp_path / "of" / "rows.csv"
    assert list(learning.missing(cases, learning.read(file))) == cases
    for case in cases[:3]:
        learning.append(file, case._asdict() | {"result": 90.125, "steps_to_90": math.nan})
    table = learning.read(file)
    assert tuple(table) == learning.COLUMNS
    assert list(learning.missing(cases, table)) == cases[3:]
    assert table["result"].tolist() == [90.125] * 3
    assert table["steps_to_90"].isna().all()
    assert table["minutes"].isna().all()


def test_the_table_has_means_the_worst_seed_and_what_a_side_gained_over_a_fresh_network(script, tmp_path):
    learning, file = script("learning"), tmp_path / "rows.csv"
    numbers = {"alone_dominant_fresh": 5.0, "alone_non_dominant_fresh": 6.0, "against_minutes": 2.0}
    for seed, result in enumerate([90.0, 96.0]):
        learning.append(
            file,
            learning.Case("ppo", "cc_s", "random_reach", seed, "")._asdict()
            | numbers
            | {"result": result, "minutes": 3.0 + seed, "largest_fall": 2.0 * seed, "share_dominant": 50.0 - 20 * seed}
            | {"alone_dominant": 10.0 + 10 * seed, "alone_non_dominant": 30.0},
        )
    (row,) = learning.summary(learning.read(file)).to_dict("records")
    expected = {
        "seeds": 2,
        "mean": 93,
        "worst": 90,
        "minutes": 3.5,
        "ratio": 1.75,
        "fall": 2,
        "gain_d": 10,
        "gain_n": 24,
    }
    assert {name: row[name] for name in expected} == expected
    assert row["share_d"] == pytest.approx(40)
    assert row["least_d"] == pytest.approx(30)


def test_the_command_line_of_a_checkout_is_found_in_its_project_file(script):
    learning = script("learning")
    said = subprocess.run([*learning.program(learning.HERE), "--help"], capture_output=True, text=True, check=True)
    assert "train" in said.stdout


def test_a_stock_peer_has_our_arms_and_updates_and_is_measured_like_ours(script):
    stock = script("stock_off_policy")
    settings = {"n_envs": 4, "timesteps": 200, "evaluation": {"every": 100, "trials": 8}}
    config = resolve("td3", "random_reach", [settings | {"td3": {"learning_starts": 40, "gradient_steps": 2}}])
    record, rows = stock.train(config)
    assert [row["timesteps"] for row in rows] == [100, 200]
    assert record.distance.shape == (1024, 50)
    model = stock.build(config)
    assert (model.n_envs, model.gradient_steps, model.batch_size) == (4, 2, 256)
    assert np.isfinite(record.vector_return).all()


def test_a_row_of_ours_is_whole(script, tmp_path):
    learning = script("learning")
    variant = "timesteps=400 n_envs=4 evaluation.every=200 evaluation.trials=8"
    case = learning.Case("a2c", "bi_s", "random_reach", 10, variant)
    row = learning.row_of(case, tmp_path, None)
    absent = {"against_minutes", "against_cpu_minutes"}
    assert set(row) == set(learning.COLUMNS) - absent
    assert row["share_dominant"] + row["share_non_dominant"] == pytest.approx(100)
