"""Sweeps, reproductions, videos and imports from Python; what they compute is tested with the commands."""

from pathlib import Path

import pytest
from made_up_answers import N, S, U, judgement
from stable_baselines3 import PPO

import bilateral_rl as brl
from bilateral_rl.api import jobs
from bilateral_rl.envs import ArmVecEnv
from bilateral_rl.io.errors import Stopped, UserError
from bilateral_rl.study.jobs import JobOutcome, JobState


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def asked(monkeypatch):
    """The jobs that a study asks for; all of them fail."""
    asked = []

    def run_local(of_study, folder, at_once, board):
        asked.extend(of_study)
        return [JobOutcome(job, JobState.FAILED, error="no time") for job in of_study]

    monkeypatch.setattr(jobs, "run_local", run_local)
    return asked


def test_a_grid_of_python_values_is_that_of_the_command(asked):
    grid = {"epochs": [1, 2], "bptt.penalty": ["weights"], "bptt.penalty_coefficient": [None, 0.01]}
    with (
        pytest.warns(UserWarning, match=r"Failed: epochs=\d,penalty=weights,penalty_coefficient=(null|0\.01): no"),
        pytest.raises(UserError, match="No training of the sweep is done; the logs are in study/logs"),
    ):
        brl.sweep(grid, seeds=2, settings={"bptt.patience": 3}, out="study", progress=False)
    configs = [job.arguments["config"] for job in asked]
    assert [(c["epochs"], c["bptt"]["penalty_coefficient"]) for c in configs] == [
        (1, None), (1, 0.01), (2, None), (2, 0.01),
    ]  # fmt: skip
    assert {(c["seeds"], c["bptt"]["patience"], c["bptt"]["penalty"]) for c in configs} == {(2, 3, "weights")}


def test_lists_are_values_of_a_grid_too(asked):
    with pytest.warns(UserWarning, match="Failed"), pytest.raises(UserError, match="No training"):
        brl.sweep({"network.critic_arch": [[32, 32], (8,)]}, "sac", out="study", progress=False)
    assert [job.arguments["config"]["network"]["critic_arch"] for job in asked] == [[32, 32], [8]]


def test_who_stops_a_study_is_told_how_to_go_on(monkeypatch):
    monkeypatch.setattr(jobs, "run_local", lambda js, *_: [JobOutcome(job, JobState.INTERRUPTED) for job in js])
    with pytest.raises(Stopped, match="Stopped with 0 of 2 jobs done; called again, it goes on"):
        brl.sweep({"epochs": [1, 2]}, progress=False)
    assert issubclass(Stopped, KeyboardInterrupt)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda: brl.sweep({}), "^A sweep needs a `grid` of 1 to 1,000 points"),
        (lambda: brl.sweep(["epochs=1"]), "^`grid` takes values by setting"),
        (lambda: brl.sweep({"epochs": "1,2"}), "^`grid` takes values by setting"),
        (lambda: brl.sweep({"epochs": [object()]}), "^`grid` takes numbers, words and lists of them"),
        (lambda: brl.sweep({"algo": ["sac"]}), "leave algo out of `grid` and `settings`"),
        (lambda: brl.sweep({"epochs": [1]}, jobs=0), "^`jobs` must be at least 1"),
        (lambda: brl.sweep({"epochs": [1]}, trials=0), "^`trials` must be at least 1"),
        (lambda: brl.reproduce("evolution"), "Unknown algorithm 'evolution'"),
        (lambda: brl.reproduce(models="cc"), "Unknown model 'cc'"),
        (
            lambda: brl.reproduce(seeds=range(2), settings={"seed": 3}),
            "the first seed, and so does `settings` seed",
        ),
        (lambda: brl.reproduce(settings={"model": "cc_s"}), "^`settings` cannot change model"),
        (lambda: brl.reproduce(readings="nonsense"), "nonsense"),
        (lambda: brl.render(), "`bilateral_rl.list_runs"),
        (lambda: brl.import_model("none.zip", "random_reach"), "There is no file none.zip"),
        (lambda: brl.import_model(3, "random_reach"), "^MODEL takes a path, not 3"),
    ],
)
def test_a_slip_is_a_sentence_and_leaves_nothing(wrong, says, tmp_path):
    with pytest.raises(UserError, match=says):
        wrong()
    assert list(tmp_path.iterdir()) == []


def test_a_saved_model_becomes_a_run_if_it_is_trusted():
    PPO("CallosalPolicy", ArmVecEnv(2), n_steps=8, batch_size=16, device="cpu").save("model.zip")
    with pytest.raises(UserError, match="add `trust_pickle=True` if you trust where it comes from"):
        brl.import_model("model.zip", "random_reach")
    run = brl.import_model("model.zip", "random_reach", trust_pickle=True, settings={"trial.threshold": 0.03})
    assert (run.status["state"], run.config.trial.threshold) == ("imported", 0.03)
    with pytest.raises(UserError, match=r"has no evaluations\.csv"):
        run.curves()


def test_a_video_is_where_it_is_wanted(loaded, tmp_path):
    with pytest.warns(UserWarning, match="Of several seeds this shows the first") as warned:
        path = loaded.render("film.gif", trials=1, size=320, progress=False)
    assert warned[0].filename == __file__
    assert path.stat().st_size > 10_000
    with pytest.raises(UserError, match=r"^`size` must be an even number of at least 320 pixels, got 321"):
        brl.render(loaded, size=321)
    with pytest.raises(UserError, match=r"^`slow_down` must be from 2 to 20"):
        brl.render(loaded, slow_down=1)


def test_a_video_refuses_its_arguments_before_anything_is_simulated(loaded, monkeypatch):
    monkeypatch.setattr("bilateral_rl.api.rendering.Evaluator", lambda *_: pytest.fail("it was simulated"))
    with pytest.raises(UserError, match=r"^`progress` must be True, False or a console of rich, got 'yes'"):
        brl.render(loaded, progress="yes")


def test_curves_are_of_every_seed_or_of_one(loaded, run):
    curves = loaded.curves()
    assert set(curves["seed"]) == {0, 1, 2}
    assert {"epoch", "validation_loss", "goal_completion_percent"} <= {*curves}
    assert set(brl.load(loaded, seed=1).curves()["seed"]) == {1}
    of_ppo = brl.load(run.path).curves()
    assert of_ppo["timesteps"].is_monotonic_increasing
    assert set(of_ppo["seed"]) == {0}


def test_a_reproduction_has_its_verdicts_as_tables():
    judgements = [judgement("text", [S, N]), judgement("everything", [U, S])]
    made = brl.Reproduction(Path("study"), judgements, [])
    assert made.report == Path("study/report.html")
    verdicts = made.verdicts.pivot_table(index="claim", columns="reading", values="verdict", aggfunc="first")
    assert verdicts.loc[["C1", "C2"], ["text", "everything"]].to_numpy().tolist() == [[S, U], [N, S]]
    assert set(made.claims["component_verdict"]) == {S, N, U}
    assert "text: Of 2 claims: 1 supported, 1 not supported" in repr(made)
