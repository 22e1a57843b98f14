"""An experiment with every feature at once, and a task of the user's own, through every command."""

import re
import sys
import textwrap

import pandas as pd
import pytest
import yaml

from bilateral_rl.config import code_tasks
from bilateral_rl.io.errors import UserError

EVERYTHING = """\
description: everything at once
start: {hand: [[0.0, 0.4], [0.05, 0.4]]}
target: {center_out: {number: 4, radius: 0.1, first_angle: 45}}
timeline:
  go: [2, 5]
  no_go_share: 0.1
  jump: {at: [3, 6], offset: [[0.02, 0.0], [-0.02, 0.0]], share: 0.3}
forces:
  load: [[1, 0], [0, 1]]
  curl: 10
  elastic_field: {stiffness: 20, center: target}
  pulse: {force: {size: 3, directions: 4}, at: 2, steps: 3, share: 0.5}
  channel: {stiffness: 500, damping: 30, share: 0.2}
  field_off_share: 0.2
trial:
  trial_length: 20
  threshold: 0.02
  length_noise: 0.01
  velocity_noise: 0.02
  vision_noise: 0.005
  motor_noise: 0.01
  proprioception_delay: 1
  vision_delay: 3
  losses: {dominant: {hand_speed: 0.1}, non_dominant: {muscle_force: 0.1, excitation_change: 0.1}, last_steps: 15}
"""
WORDS, OF_ONE_ARM, TRIAL = re.split(r"(?=^start:|^trial:)", EVERYTHING, flags=re.MULTILINE)
TWO_ARMS = f"""\
{WORDS}arms:
  dominant:
{textwrap.indent(OF_ONE_ARM.replace("[[0.0, 0.4], [0.05, 0.4]]", "[[0.15, 0.4], [0.2, 0.4]]"), 4 * " ")}
  non_dominant: {{start: {{hand: [-0.15, 0.4]}}, target: start, forces: {{load: drawn}}}}
exchange: 0.5
{TRIAL}  two_arms: {{spring: {{stiffness: 30, damping: 1, kind: distance}}}}
"""
CLASS = """\
import numpy as np
from bilateral_rl.envs import Task, Trials
class Reach(Task):
    id = "short_reach"
    n_uniform = 2
    has_load = False
    trial = {"trial_length": 12}
    def trials(self, uniform, settings):
        start = np.tile(np.float32([[0.8, 1.5]]), (len(uniform), 1))
        return Trials(start, start + np.float32(0.2 * uniform), np.zeros_like(start))
"""
RL = ("timesteps=160", "n_envs=8", "network.critic_arch=[8]", "evaluation.trials=4", "evaluation.every=80")
SMALL = {
    "ppo": (*RL, "ppo.n_steps=10", "ppo.batch_size=40"),
    "a2c": (*RL, "a2c.n_steps=10"),
    "sac": (*RL, "sac.learning_starts=40", "sac.batch_size=16"),
    "td3": (*RL, "td3.learning_starts=40", "td3.batch_size=16", "td3.critic_warm_up=2"),
    "bptt": ("epochs=1", "bptt.trials=32", "bptt.batch_size=16", "bptt.validation_trials=8"),
}
RETRAINING = ("--lesion", "deep_dominant", "--retrain", "everything")


def settings(algo, *others):
    return [part for one in (*SMALL[algo], "network.hidden_noise=0.05", *others) for part in ("--set", one)]


@pytest.fixture
def everything(tmp_path):
    (tmp_path / "everything.yaml").write_text(EVERYTHING)
    return "everything.yaml"


@pytest.fixture
def reach(tmp_path, monkeypatch):
    """A module of a task in the working directory; nobody has named it yet."""
    (tmp_path / "my_reach.py").write_text(CLASS)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(code_tasks, "_NAMED", set())
    yield "my_reach:Reach"
    sys.modules.pop("my_reach", None)


def forget(monkeypatch):
    """What a new process knows of what was named before."""
    monkeypatch.setattr(code_tasks, "_NAMED", set())


def test_a_file_with_every_feature_is_trained_tested_and_recorded_without_the_file(invoke, everything, tmp_path):
    code, out = invoke("train", "--task", everything, "--algo", "ppo", *settings("ppo"))
    assert code == 0, out
    run = "runs/everything/cc_s-ppo-1"
    stored = yaml.safe_load((tmp_path / run / "config.yaml").read_text())
    assert stored["experiment"]["forces"]["curl"] == 10
    assert stored["trial"]["losses"]["dominant"]["hand_speed"] == 0.1
    (tmp_path / everything).unlink()
    assert invoke("train", "--resume", run, "--timesteps", 240)[0] == 0
    channel = ("experiment.forces.channel.share=1", "experiment.forces.field_off_share=0")
    changes = [part for one in (*channel, "trial.vision_noise=0") for part in ("--set", one)]
    code, out = invoke("evaluate", run, "--trials", 4, *changes)
    assert code == 0
    changed = "experiment.forces.channel.share = 1.0; experiment.forces.field_off_share = 0.0; trial.vision_noise = 0.0"
    assert changed in " ".join(out.split())
    assert invoke("record", run, "--trials", 6, "--out", "r.csv")[0] == 0
    table = pd.read_csv(tmp_path / "r.csv")
    assert table.target_index.between(0, 3).all()
    assert table.force_x_N.abs().max() > 0
    assert "everything" in invoke("list")[1]


def test_a_file_with_every_feature_is_learned_by_bptt_lesioned_and_published(invoke, everything):
    code, out = invoke("train", "--task", everything, "--algo", "bptt", *settings("bptt"))
    assert code == 0, out
    run = "runs/everything/cc_s-bptt-1"
    assert f"--task {run}/config.yaml --init-from {run}:0" in out
    assert invoke("train", "--resume", run, "--epochs", 2)[0] == 0
    assert invoke("lesion", run, "--trials", 4, *RETRAINING)[0] == 0
    assert invoke("compare", run, "--trials", 4)[0] == 0
    assert invoke("export", run, "--trials", 4, "--out", "published")[0] == 0
    assert invoke("evaluate", "published", "--trials", 4, "--task", "curl_field")[0] == 0
    code, out = invoke("train", "--task", f"{run}/config.yaml", "--init-from", run, *settings("ppo"))
    assert code == 0, out


@pytest.mark.slow
@pytest.mark.parametrize("algo", SMALL)
@pytest.mark.parametrize("of", [EVERYTHING, TWO_ARMS], ids=["one arm", "two arms"])
def test_every_algorithm_goes_through_every_command_with_every_feature(invoke, everything, algo, of, tmp_path):
    (tmp_path / everything).write_text(of)
    run, more = f"runs/everything/cc_s-{algo}-1", ("--epochs", 2) if algo == "bptt" else ("--timesteps", 240)
    assert invoke("train", "--task", everything, "--algo", algo, *settings(algo))[0] == 0
    assert invoke("train", "--task", everything, "--algo", algo, "--model", "uni_b", *settings(algo))[0] == 0
    assert invoke("train", "--resume", run, *more)[0] == 0
    for command in (
        ("evaluate", run, "--trials", 4),
        ("record", run, "--trials", 4, "--out", "r.npz", "--lesion", "deep_dominant"),
        ("lesion", run, "--trials", 4, *RETRAINING),
        ("compare", run, f"runs/everything/uni_b-{algo}-1", "--trials", 4),
        ("render", run, "--trials", 2),
        ("evaluate", run, "--trials", 40, "--by", "target"),
        ("export", run, "--trials", 4, "--out", "published"),
    ):
        code, out = invoke(*command)
        assert code == 0, out


def test_an_experiment_of_two_arms_is_learned_changed_arm_by_arm_and_told_by_hand_and_target(invoke, tmp_path):
    arm = "{{start: {{hand: [{x}, 0.4]}}, target: {target}, forces: {{load: [1, 0]}}}}"
    arms = {
        "dominant": arm.format(x=0.18, target="{center_out: {number: 2}}"),
        "non_dominant": arm.format(x=-0.18, target="start"),
    }
    (tmp_path / "both.yaml").write_text(
        "arms:\n" + "".join(f"  {side}: {of}\n" for side, of in arms.items()) + "exchange: 0.5\n"
    )
    assert invoke("train", "--task", "both.yaml", "--algo", "ppo", *settings("ppo"))[0] == 0
    run, changed = "runs/both/cc_s-ppo-1", "experiment.arms.non_dominant.forces.load=[0,2]"
    assert invoke("record", run, "--trials", 4, "--set", changed, "--out", "r.csv")[0] == 0
    table = pd.read_csv(tmp_path / "r.csv").drop_duplicates("trial")
    loads = {(row.role_dominant, row.load_dominant_x_N, row.load_non_dominant_y_N) for row in table.itertuples()}
    assert loads == {("reach", 1.0, 2.0), ("hold", 0.0, 0.0)}  # exchanged: the load of a reach is mirrored
    code, out = invoke("evaluate", run, "--trials", 16, "--by", "target", "--csv", "parts.csv")
    assert code == 0, out
    parts = pd.read_csv(tmp_path / "parts.csv")
    assert list(zip(parts.target, parts.hand, parts.target_angle_deg.round(), strict=True)) == [
        (0, "dominant", 0), (0, "non_dominant", 180), (1, "dominant", 180), (1, "non_dominant", 0),
    ]  # fmt: skip
    assert parts.trials.sum() == 16


@pytest.mark.slow
def test_experiments_and_their_settings_are_points_of_a_sweep(invoke, everything, tmp_path):
    sweep = ("sweep", "--trials", 4, "--jobs", 1, *settings("bptt"))
    assert invoke(*sweep, "--grid", f"task=curl_field,{everything}", "--out", "tasks")[0] == 0
    assert set(pd.read_csv(tmp_path / "tasks/sweep.csv").task) == {"curl_field", "everything"}
    (tmp_path / everything).write_text(EVERYTHING.replace("curl: 10", "curl: 12"))
    with pytest.raises(UserError, match="tasks"):
        invoke(*sweep, "--grid", f"task=curl_field,{everything}", "--out", "tasks")
    grid = ("--set", f"task={everything}", "--grid", "experiment.forces.curl=5,6", "--out", "curls")
    assert invoke(*sweep, *grid)[0] == 0


def test_a_broken_file_ends_in_a_sentence_and_leaves_nothing_behind(invoke, tmp_path):
    (tmp_path / "broken.yaml").write_text("start: {hand: [0, 0.4]}\ntarget: {center_out: {radius: 0.5}}\n")
    for command in (("train",), ("sweep", "--grid", "seed=1,2"), ("sweep", "--grid", "task=broken.yaml")):
        task = ("--task", "broken.yaml") if command == ("train",) else ("--set", "task=broken.yaml")
        with pytest.raises(UserError, match=r"^broken\.yaml, line 2: target\.center_out: the position \[.*\] m is"):
            invoke(*command, *task)
        assert [path.name for path in tmp_path.iterdir()] == ["broken.yaml"]


def test_a_class_goes_through_the_commands_that_name_it_and_no_others(invoke, reach, monkeypatch):
    assert invoke("train", "--task", reach, "--algo", "ppo", *settings("ppo"))[0] == 0
    run, named = "runs/short_reach/cc_s-ppo-1", ("--task", reach)
    for command in (
        ("evaluate", run, "--trials", 4),
        ("record", run, "--trials", 4, "--out", "r.npz"),
        ("lesion", run, "--trials", 4, "--lesion", "deep_dominant", "--no-retrain"),
        ("render", run, "--trials", 1),
        ("export", run, "--trials", 4, "--out", "published"),
        ("train", "--resume", run, "--timesteps", 240),
    ):
        forget(monkeypatch)
        with pytest.raises(UserError, match=f"if you trust that, say so by --task {reach}"):
            invoke(*command)
        code, out = invoke(*command, *named)
        assert code == 0, out
    assert invoke("list")[0] == 0
    with pytest.raises(UserError, match=f"learned {reach}, and --task random_reach names something else"):
        invoke("lesion", run, "--task", "random_reach")


@pytest.mark.slow
def test_a_class_is_compared_and_swept(invoke, reach, monkeypatch, tmp_path):
    for model in ("cc_s", "uni_b"):
        assert invoke("train", "--task", reach, "--algo", "bptt", "--model", model, *settings("bptt"))[0] == 0
    forget(monkeypatch)
    runs = [f"runs/short_reach/{model}-bptt-1" for model in ("cc_s", "uni_b")]
    with pytest.raises(UserError, match="importing it runs its code"):
        invoke("compare", *runs, "--trials", 4)
    assert invoke("compare", *runs, "--trials", 4, "--task", reach)[0] == 0
    forget(monkeypatch)
    sweep = ("sweep", "--grid", "seed=1,2", "--set", f"task={reach}", "--trials", 4, "--jobs", 1)
    code, out = invoke(*sweep, *settings("bptt"))
    assert code == 0, out
    assert len(pd.read_csv(tmp_path / "runs/sweep/sweep.csv").seed.unique()) == 2
