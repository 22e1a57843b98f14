"""Tasks of configurations: names, experiments and their files, and classes that the user has to name."""

import dataclasses
import subprocess
import sys

import pytest
import yaml

from bilateral_rl.config import code_tasks
from bilateral_rl.config.code_tasks import allow_code
from bilateral_rl.config.parse import merge, parse_overrides
from bilateral_rl.config.resolve import from_values, resolve, tuned_defaults
from bilateral_rl.envs import ArmEnv, Experiment, HoldPosition, experiment_named
from bilateral_rl.envs.experiments.task import ExperimentTask
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.yaml_files import read_settings
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import build_policy, load_policy
from bilateral_rl.vocabulary import SIDES

MINE = """\
start: {hand: [0.0, 0.4]}
target: {center_out: {number: 3}}
forces: {curl: 5}
trial: {trial_length: 33, threshold: 0.03, losses: {dominant: {hand_speed: 0.5}}}
"""
CLASS = """\
import numpy as np
from bilateral_rl.envs import Task, Trials
from bilateral_rl.envs.task import Spring
class Reach(Task):
    id = "short_reach"
    n_uniform = 2
    has_load = False
    judged_by = "time_in_goal"
    trial = {"trial_length": 12}
    def trials(self, uniform, settings):
        start = np.tile(np.float32([[0.8, 1.5]]), (len(uniform), 1))
        return Trials(start, start + np.float32(0.2 * uniform), np.zeros_like(start))
class Both(Reach):
    n_arms = 2
    def trials(self, uniform, settings):
        start = np.tile(np.float32([[0.8, 1.5]]), (len(uniform), 2, 1))
        nothing = np.zeros(len(uniform))
        return Trials(start, start, np.zeros_like(start), spring=Spring(nothing, nothing))
class NoTask: pass
class Broken(Reach):
    def __init__(self): raise RuntimeError("no")
"""


@pytest.fixture
def mine(tmp_path):
    (tmp_path / "mine.yaml").write_text(MINE)
    return str(tmp_path / "mine.yaml")


@pytest.fixture
def named(tmp_path, monkeypatch):
    """A module of a task in the working directory, and a process to which nobody has named anything."""
    (tmp_path / "my_own_tasks.py").write_text(CLASS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(code_tasks, "_NAMED", set())
    yield "my_own_tasks:Reach"
    sys.modules.pop("my_own_tasks", None)


@pytest.mark.parametrize("algo", ["ppo", "a2c", "sac", "td3", "bptt"])
def test_an_experiment_has_the_tuned_defaults_of_its_kind_of_task_under_its_own_settings(algo, mine):
    for task, kind in ((mine, "random_reach"), (dataclasses.replace(hold(), name="still"), "hold_position")):
        config = resolve(algo, task)
        usual = from_values({"algo": algo} | tuned_defaults(algo, kind)).to_values()
        values = config.to_values()
        assert {name for name in values if values[name] != usual[name]} <= {"task", "experiment", "trial", "blocks"}
    assert resolve(algo, mine).trial.trial_length == 33


def hold():
    return Experiment(name="hold", start={"hand": [0.0, 0.4]}, target="start", forces={"load": "drawn"})


def test_the_users_settings_lie_over_the_files_and_those_over_the_defaults(mine):
    config = resolve("ppo", mine, [parse_overrides(["trial.trial_length=40", "trial.losses.dominant.activation=1"])])
    assert (config.trial.trial_length, config.trial.threshold) == (40, 0.03)
    losses = config.trial.losses.dominant
    assert (losses.hand_speed, losses.activation, losses.cartesian_2) == (0.5, 1.0, 5.0)


def test_a_configuration_keeps_the_whole_experiment_and_needs_no_file(mine, tmp_path):
    config = resolve("ppo", mine)
    assert (config.task, config.experiment.name, config.task_folder) == ("mine", "mine", "mine")
    assert isinstance(config.make_task(), ExperimentTask)
    assert config.make_task().experiment == config.experiment
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config.to_values()))
    (tmp_path / "mine.yaml").unlink()
    assert resolve(None, None, [read_settings(tmp_path / "config.yaml")]) == config


def test_an_experiment_is_changed_by_settings(mine):
    config = resolve("bptt", mine, [parse_overrides(["experiment.forces.curl=10", "experiment.timeline.go=[3,4]"])])
    assert config.experiment.forces.curl == 10
    assert config.experiment.timeline.go == (3, 4)
    assert config.experiment.target == resolve("bptt", mine).experiment.target
    again = resolve(None, None, [config.to_values(), {"experiment": {"forces": {"field_off_share": 0.5}}}])
    assert (again.experiment.forces.curl, again.experiment.forces.field_off_share) == (10, 0.5)
    renamed = resolve("bptt", mine, [parse_overrides(["experiment.name=weak"])])
    assert (renamed.task, renamed.experiment.name) == ("weak", "weak")


def test_an_experiment_of_two_arms_is_changed_arm_by_arm(tmp_path):
    arm = "{start: {hand: [%s, 0.4]}, target: {center_out: {}}, forces: {curl: 5}}"
    (tmp_path / "both.yaml").write_text(f"arms:\n  dominant: {arm % 0.2}\n  non_dominant: {arm % -0.2}\n")
    both = tmp_path / "both.yaml"
    config = resolve("bptt", both, [parse_overrides(["experiment.arms.dominant.forces.curl=10"])])
    forces = [getattr(config.experiment.arms, side).forces.curl for side in SIDES]
    assert forces == [10, 5]
    assert (config.n_arms, config.network.units, config.blocks.every) == (2, 20, 10)
    assert resolve(None, None, [config.to_values()]) == config
    for setting, sentence in (
        ("experiment.arms.dominant.forces.curl=2000", r"experiment\.arms\.dominant\.forces\.curl: a velocity field of"),
        ("experiment.forces.curl=10", "experiment.forces must stand under arms"),
        (
            "experiment.arms.dominant.target.center_out.radius=0.5",
            r"center_out: the position \[.*\[0\.18, 0\] m",
        ),
        ("trial.two_arms.spring.stiffness=5000", r"^trial\.two_arms\.spring: a spring of 5000 N/m"),
    ):
        with pytest.raises(UserError, match=sentence):
            resolve("bptt", both, [parse_overrides([setting])])


def test_tasks_of_two_arms_have_their_own_settings_of_trials():
    assert resolve("bptt", "reach_and_hold").trial.two_arms.spring.stiffness == 50
    assert resolve("bptt", "two_holds").trial.two_arms.spring.stiffness == 0
    with pytest.raises(UserError, match="two_holds cannot run so: a spring of 5000 N/m"):
        resolve("bptt", "two_holds", [parse_overrides(["trial.two_arms.spring.stiffness=5000"])])
    with pytest.raises(UserError, match=r"trial\.two_arms has no effect on random_reach, whose trials have one arm"):
        resolve("bptt", None, [parse_overrides(["trial.two_arms.spring.stiffness=50"])])


@pytest.mark.parametrize("task", ["two_reaches", "two_holds", "bimanual_reaches"])
@pytest.mark.parametrize("chosen", [{"roles": "dominant_reaches"}, {"reach": [0.1, 0.15]}], ids=["roles", "reach"])
def test_roles_are_refused_where_settings_do_not_choose_them_by_the_words_of_the_environments(task, chosen):
    with pytest.raises(ValueError, match=rf"^two_arms\.{next(iter(chosen))} has no effect on {task}") as of_environment:
        ArmEnv(task, two_arms=chosen)
    run = resolve("bptt", task)
    assert resolve(None, None, [run.to_values()]) == run
    choice = {"trial": {"two_arms": chosen}}
    by_hand = merge(run.to_values(), choice)
    of_another = resolve("bptt", "reach_and_hold", [choice]).to_values()
    for of_task, layer in ((task, choice), (None, by_hand), (task, of_another)):
        with pytest.raises(UserError) as refused:
            resolve("bptt", of_task, [layer])
        assert str(refused.value) == f"trial.{of_environment.value}"


def test_an_experiment_may_stand_in_a_file_of_settings():
    values = {"algo": "bptt", "experiment": yaml.safe_load(MINE) | {"name": "mine"}}
    assert resolve(None, None, [values]).experiment.forces.curl == 5
    assert resolve(None, "curl_field", [values]).experiment == experiment_named("curl_field")


def test_the_configuration_of_another_experiments_run_brings_its_choices_alone(mine):
    run = resolve("ppo", mine, [{"seed": 3, "trial": {"threshold": 0.04}}]).to_values()
    for task in ("random_reach", "center_out"):
        assert resolve(None, task, [run]) == resolve("ppo", task, [{"seed": 3, "trial": {"threshold": 0.04}}])
    assert resolve(None, None, [run, {"task": "random_reach"}]).experiment is None


@pytest.mark.parametrize(
    ("task", "settings", "sentence"),
    [
        (
            "random_reach",
            ["experiment.forces.curl=10"],
            "experiment.forces changes nothing: random_reach",
        ),
        ("curl_field", ["experiment.forces.crul=10"], "Unknown setting 'crul' in experiment.forces; choose from load"),
        ("curl_field", ["experiment.forces.curl=fast"], "experiment.forces.curl must be a finite number, got 'fast'"),
        (
            "curl_field",
            ["experiment.forces.velocity_field=[[0,1],[1,0]]"],
            "experiment.forces.curl is a vel",
        ),
        ("curl_field", ["experiment.target.center_out.radius=0.5"], "experiment.target.center_out: the position"),
        ("curl_field", ["experiment.forces.curl=2000"], "experiment.forces.curl: a velocity field"),
        ("delayed_reach", ["trial.trial_length=30"], "experiment.timeline.go must come within the trial of 30 steps"),
        ("curl_field", ["trial.arm.link_length=[0.1,0.1]"], "experiment.start.hand: the position [0, 0.4] m is out of"),
        ("curl_field", ["experiment.trial.threshold=0.1"], "experiment.trial keeps what the experiment's file says"),
        ("curl_field", ["experiment=3"], "experiment must be settings by name, got 3"),
        (
            "curl_feild",
            [],
            "Unknown task 'curl_feild'; choose from random_reach, hold_position, ",
        ),
        ("none.yaml", [], "There is no experiment none.yaml"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(task, settings, sentence):
    with pytest.raises(UserError) as error:
        resolve("bptt", task, [parse_overrides(settings)])
    assert str(error.value).startswith(sentence)


def test_what_names_no_task_is_refused():
    for wrong in (3, [1], HoldPosition(), HoldPosition):
        with pytest.raises(
            UserError, match="A task is given by its name, as an Experiment or the file of one, or as a"
        ):
            resolve("ppo", wrong)


def test_a_class_is_imported_only_where_the_user_has_named_it(named):
    config = resolve("ppo", named)
    assert (config.task, config.experiment) == (named, None)
    with pytest.raises(UserError, match=rf"The task is a class, {named}, .* say so by --task {named}"):
        config.make_task()
    assert "my_own_tasks" not in sys.modules
    allow_code([named])
    assert config.make_task().id == config.task_folder == "short_reach"
    assert config.judged_by == "time_in_goal"


def test_a_class_brings_its_settings_and_the_defaults_of_its_kind(named):
    allow_code([named])
    config = resolve("ppo", named, [{"trial": {"threshold": 0.04}}])
    assert (config.trial.trial_length, config.trial.threshold) == (12, 0.04)
    assert config.ppo == resolve("ppo", "hold_position").ppo
    assert resolve(None, None, [config.to_values()]) == config


def test_a_class_may_be_for_two_arms_which_is_known_where_it_is_named(named, tmp_path):
    both = named.replace("Reach", "Both")
    with pytest.raises(UserError, match=f"The task is a class, {both}"):
        resolve("ppo", both, [{"network": {"ipsilateral_share": 0.3}}])
    allow_code([both])
    config = resolve("ppo", both, [{"network": {"ipsilateral_share": 0.3}}])
    assert (config.n_arms, config.n_muscles, config.network.units) == (2, 12, 20)
    assert config.ppo == resolve("ppo", "two_holds").ppo
    folder = RunFolder.create(tmp_path, config)
    folder.save_weights("final", dict(build_policy(config).state_dict()))
    assert load_policy(folder).motor_network.ipsilateral_share == 0.3
    folder.write_config(dataclasses.replace(config, network=resolve("ppo", "two_holds").network))
    code_tasks._NAMED.clear()
    with pytest.raises(UserError, match=f"say so by --task {both}"):
        load_policy(folder)


@pytest.mark.parametrize(
    ("task", "sentence"),
    [
        ("my_own_tasks:NoTask", "my_own_tasks:NoTask is no task: it must be a subclass"),
        ("my_own_tasks:Broken", "The task my_own_tasks:Broken cannot be made: RuntimeError: no."),
        ("my_own_tasks:Nothing", "The task my_own_tasks:Nothing cannot be made: AttributeError"),
        ("no_such_module:Reach", "The task no_such_module:Reach cannot be made: ModuleNotFoundError"),
    ],
)
def test_a_class_that_is_no_task_is_refused(named, task, sentence):
    allow_code([task])
    with pytest.raises(UserError) as error:
        resolve("ppo", task).make_task()
    assert str(error.value).startswith(sentence)


def test_the_run_of_a_stranger_reads_no_file_of_an_experiment_beside_it(mine, tmp_path):
    (tmp_path / "config.yaml").write_text(yaml.safe_dump({"algo": "ppo", "model": "cc_s", "task": mine}))
    with pytest.raises(UserError, match="its task is the file of an experiment"):
        RunFolder(tmp_path).config()


def test_reading_the_configuration_of_a_stranger_runs_no_code(named, tmp_path):
    values = resolve("ppo", named).to_values()
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(values))
    code = "import sys; from bilateral_rl.runs.folder import RunFolder; from pathlib import Path"
    code += "; c = RunFolder(Path('.')).config(); assert c.task == 'my_own_tasks:Reach'"
    code += "; assert 'my_own_tasks' not in sys.modules"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, cwd=tmp_path).returncode == 0


def test_trials_of_two_arms_are_tested_both_ways_so_their_number_is_even():
    with pytest.raises(UserError, match=r"^evaluation\.trials must be even in two_reaches.* got 5"):
        resolve("ppo", "two_reaches", [parse_overrides(["evaluation.trials=5"])])
    fixed = ["evaluation.trials=5", "trial.two_arms.roles=dominant_reaches"]
    assert resolve("ppo", "reach_and_hold", [parse_overrides(fixed)]).evaluation.trials == 5
