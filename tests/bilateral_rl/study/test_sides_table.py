"""What the sides of trained networks supply, as the report shows it."""

import pytest
import torch

from bilateral_rl.analysis.modulation import SideModulation, side_modulation
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.runs.policies import load_policies
from bilateral_rl.study.sides_table import sides_tables
from bilateral_rl.training.run import train
from bilateral_rl.vocabulary import TEST_SEED


def test_a_row_is_the_mean_over_all_seeds_of_all_runs(bptt_run):
    (table,) = sides_tables({"random_reach": {"cc_s": [bptt_run]}})
    config = bptt_run.config()
    evaluator = Evaluator(config.task, config.trial, 128, TEST_SEED)
    sides = [side_modulation(p.motor_network, evaluator.run(p)) for p in load_policies(bptt_run).values()]
    assert len(sides) > 1
    ((name, *cells),) = table.rows
    assert name == "Random reach, CC-S"
    assert len(table.columns) == len(cells) + 1
    shares = torch.tensor([side.percent["dominant"] for side in sides])
    assert cells[0] == f"{shares.mean():.1f} ± {shares.std():.1f}"
    shown = [float(cells[i].split()[0]) for i in (0, 2)]
    assert sum(shown) == pytest.approx(100, abs=0.11)
    silent = [sum(name in side.silent for side in sides) for name in ("dominant", "non_dominant")]
    assert cells[-2:] == [f"{n} of {len(sides)}" for n in silent]
    (both,) = sides_tables({"random_reach": {"cc_s": [bptt_run, bptt_run]}})
    assert both.rows[0][-1] == f"{2 * silent[1]} of {2 * len(sides)}"


def test_a_side_whose_weight_is_0_is_silent(bptt_run, monkeypatch):
    def without_dominant(run):
        policies = load_policies(run)
        for policy in policies.values():
            with torch.no_grad():
                policy.motor_network.combination_dominant.zero_()
        return policies

    monkeypatch.setattr("bilateral_rl.study.sides_table.load_policies", without_dominant)
    (table,) = sides_tables({"random_reach": {"cc_s": [bptt_run]}})
    n = len(load_policies(bptt_run))
    assert table.rows[0][1].startswith("0.0 ± 0")
    assert table.rows[0][-2] == f"{n} of {n}"


def test_of_two_arms_each_has_a_row(bptt_run, monkeypatch):
    paths = ("dominant_arm/dominant", "dominant_arm/non_dominant", "non_dominant_arm/dominant",
             "non_dominant_arm/non_dominant")  # fmt: skip
    supplied = SideModulation(dict(zip(paths, (3.0, 1.0, 1.0, 19.0), strict=True)), dict.fromkeys(paths, 0.5))
    monkeypatch.setattr("bilateral_rl.study.sides_table.side_modulation", lambda *_: supplied)
    (table,) = sides_tables({"reach_and_hold": {"cc_s": [bptt_run]}})
    n = len(load_policies(bptt_run))
    assert [row[0] for row in table.rows] == [
        f"Reach and hold, CC-S, {name} arm" for name in ("dominant", "non-dominant")
    ]
    assert [row[1].split()[0] for row in table.rows] == ["75.0", "5.0"]
    assert [row[-2] for row in table.rows] == [f"0 of {n}", f"{n} of {n}"]


def test_networks_without_sides_have_no_table(tmp_path, small_bptt):
    run = train(small_bptt("uni_b", epochs=1), tmp_path).folder
    assert list(sides_tables({"random_reach": {"uni_b": [run]}})) == []
    assert list(sides_tables({"random_reach": {}, "hold_position": {}})) == []
