import csv

import numpy as np
import pandas as pd
import pytest
import torch
from stable_baselines3.common.monitor import load_results
from supervised_runs import contents, with_values
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from bilateral_rl.config.resolve import resolve
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import find_runs
from bilateral_rl.runs.policies import load_policy
from bilateral_rl.training.run import resume, train


def rows(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize(("model", "task"), [("uni_dl", "random_reach"), ("bi_ns", "hold_position")])
def test_a_run_of_another_model_and_task_acts_from_its_folder(tmp_path, small, model, task):
    config = with_values(small, model=model, task=task, timesteps=1_000)
    outcome = train(config, tmp_path)
    policy = load_policy(outcome.folder)
    observation = np.zeros((3, 16), dtype=np.float32)
    expected, _ = outcome.policies[config.seed].predict(observation, deterministic=True)
    np.testing.assert_array_equal(policy.predict(observation, deterministic=True)[0], expected)
    assert outcome.folder.path == tmp_path / task / f"{model}-ppo-1"


def test_the_run_folder_holds_what_it_promises(run):
    names = {path.name for path in run.path.iterdir()}
    assert {"config.yaml", "versions.json", "status.json", "resume.safetensors"} <= names
    assert {"monitor.csv", "evaluations.csv", "weights"} <= names
    assert any(name.startswith("events.out.tfevents") for name in names)
    assert {"best", "final"} < set(run.weight_names())
    assert run.status() == {"state": "finished", "timesteps": 4000, "updates": 20, "weights": "final"}

    files = [path for path in run.path.rglob("*") if path.is_file()]
    suffixes = {path.suffix for path in files if "tfevents" not in path.name}
    assert suffixes <= {".yaml", ".json", ".csv", ".safetensors"}, "no pickle"
    assert len({path.stat().st_mode for path in files}) == 1, "who may read the configuration may read everything"


def test_sb3_reads_the_monitor_file(run):
    results = load_results(str(run.path))
    assert len(results) == 4_000 // 50
    assert (results["l"] == 50).all()
    np.testing.assert_allclose(results["r"], (results["dominant"] + results["non_dominant"]) / 2, rtol=1e-4)
    frame = pd.read_csv(run.path / "monitor.csv", skiprows=1)
    assert frame.notna().all().all()
    assert list(frame.columns) == ["r", "l", "t", "dominant", "non_dominant"]


def test_evaluations_come_by_environment_steps_whatever_n_envs_is(tmp_path, small, run):
    fewer = train(with_values(small, n_envs=10, evaluation={"every": 2_000}), tmp_path / "fewer").folder
    for folder in (run, fewer):
        assert [int(row["timesteps"]) for row in rows(folder.path / "evaluations.csv")] == [0, 2000, 4000]


def test_the_best_weights_are_those_of_the_best_evaluation(run):
    best = max(rows(run.path / "evaluations.csv"), key=lambda row: float(row["return_scalar"]))
    final = torch.cat([t.ravel() for t in run.load_weights("final").values()])
    at_best = torch.cat([t.ravel() for t in run.load_weights("best").values()])
    assert torch.equal(final, at_best) == (best["timesteps"] == "4000")


def test_tensorboard_shows_the_two_streams_side_by_side(run):
    events = EventAccumulator(str(run.path), size_guidance={"images": 0})
    events.Reload()
    scalars, images = set(events.Tags()["scalars"]), set(events.Tags()["images"])
    for quantity in ("return", "evaluation_return", "value_loss", "policy_loss", "explained_variance", "combination"):
        assert {f"{quantity}/dominant", f"{quantity}/non_dominant"} <= scalars
    for group in ("dominant", "non_dominant", "shared", "critic_0", "critic_1"):
        assert {f"gradient_norm/{group}", f"gradient_norm_clipped/{group}"} <= scalars
    for measure in ("goal_completion_percent", "speed_to_goal_cm_per_step", "time_in_goal_steps", "final_error_cm"):
        assert f"evaluation/{measure}" in scalars
    assert {"rollout/ep_rew_mean", "rollout/success_rate", "time/fps", "train/approx_kl"} <= scalars
    assert any(tag.startswith("figures/hand_paths") for tag in images)


def test_the_same_seed_gives_the_same_weights_and_another_seed_others(tmp_path, small, run, same_bits):
    again, other = (
        train(config, tmp_path).folder.load_weights("final") for config in (small, with_values(small, seed=1))
    )
    assert same_bits(again, run.load_weights("final"))
    assert not torch.equal(again["log_std"], other["log_std"])


def test_a_finished_run_is_not_resumed_without_more_steps(run):
    with pytest.raises(UserError, match="timesteps"):
        resume(run, run.config())


def test_a_run_killed_after_its_last_step_is_finished_by_resuming(run):
    before = contents(run)
    run.write_json("status.json", run.status() | {"state": "running"})
    resume(run, run.config())
    after = contents(run)
    for name in ("config.yaml", "evaluations.csv", "monitor.csv", "status.json", "weights/final.safetensors"):
        assert after[str(run.path / name)] == before[str(run.path / name)], name


def test_a_damaged_resume_file_is_refused(run):
    sound = run.load_resume()
    for damage in (
        {"optimizer.x.exp_avg": torch.zeros(1)},
        {"evaluation.best_return": torch.tensor(float("nan"), dtype=torch.float64)},
        {"evaluation.weights.log_std": torch.zeros(7)},
        {"file.monitor.csv": torch.zeros(1)},
        {"file.passwords": torch.tensor(0)},
        {"weights.policy.log_std": torch.full((6,), float("inf"))},
        {"counter.update_rules": torch.tensor(float("inf"))},
    ):
        run.save_resume(sound | damage)
        with pytest.raises(UserError, match="damaged"):
            resume(run, with_values(run.config(), timesteps=8_000))


def test_weights_of_another_network_are_refused(run):
    run.write_config(with_values(run.config(), network={"units": 12}))
    with pytest.raises(UserError, match="do not fit"):
        load_policy(run)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_default_training_learns_to_reach(tmp_path, seed):
    from bilateral_rl.analysis.trials import Evaluator

    config = resolve(None, None, [{"seed": seed}])
    outcome = train(config, tmp_path)
    record = Evaluator(config.task, config.trial, 1024, 2_000_000).run(outcome.policies[config.seed])
    assert record.summary(0.05)["goal_completion_percent"] >= 90


def test_a_diverged_training_is_one_sentence_and_keeps_what_was_saved(tmp_path, small):
    with pytest.raises(UserError, match=r"diverged.*learning_rate"):
        train(with_values(small, ppo={"learning_rate": 1e30, "max_grad_norm": 1e30}), tmp_path)
    (folder,) = find_runs(tmp_path)
    assert folder.status()["state"] == "failed"
    assert "final" not in folder.weight_names()


def test_a_run_that_was_never_saved_says_how_to_start_anew(run):
    run.write_json("status.json", {"state": "running", "timesteps": 0, "updates": 0})
    (run.path / "resume.safetensors").unlink()
    with pytest.raises(UserError, match="--config"):
        resume(run, with_values(run.config(), timesteps=8_000))


def test_a_damaged_status_is_refused(run):
    for status in ([], {"timesteps": "abc"}, {"timesteps": 4000, "weights": 3}):
        run.write_json("status.json", status)
        with pytest.raises(UserError, match="damaged"):
            resume(run, with_values(run.config(), timesteps=8_000))


def damage_state(run):
    run.save_resume({name: t for name, t in run.load_resume().items() if name != "random.torch"})


def damage_evaluations(run):
    (run.path / "evaluations.csv").write_text("nonsense\n1\n")


def damage_monitor(run):
    path = run.path / "monitor.csv"
    path.write_bytes(path.read_bytes()[:-20])


@pytest.mark.parametrize("damage", [damage_state, damage_evaluations, damage_monitor])
def test_a_refused_resume_leaves_the_run_as_it_was(run, damage):
    damage(run)
    before = contents(run)
    with pytest.raises(UserError, match="damaged"):
        resume(run, with_values(run.config(), timesteps=8_000))
    assert contents(run) == before


def test_damaged_logs_moved_away_are_begun_anew(run):
    for name in ("evaluations.csv", "monitor.csv"):
        (run.path / name).unlink()
    resume(run, with_values(run.config(), timesteps=8_000))
    assert [int(row["timesteps"]) for row in rows(run.path / "evaluations.csv")] == [6_000, 8_000]
    assert len(load_results(str(run.path))) == 4_000 // 50


def test_more_timesteps_stretch_the_schedules(run):
    resume(run, with_values(run.config(), timesteps=8_000))
    events = EventAccumulator(str(run.path))
    events.Reload()
    rate = run.config().ppo.learning_rate
    present = {event.step: event.value for event in events.Scalars("train/learning_rate")}
    assert present[2_000] == pytest.approx(rate * 0.5)
    assert present[4_000] == pytest.approx(0, abs=1e-9)
    assert present[6_000] == pytest.approx(rate * 0.25)
    assert run.status() == {"state": "finished", "timesteps": 8_000, "updates": 40, "weights": "final"}
