"""Experiments are read from YAML, and what is wrong in a file is said by file, line and field."""

import dataclasses

import pytest
import yaml

from bilateral_rl.config.parse import plain
from bilateral_rl.envs import Experiment, ExperimentError, experiment_from_file, experiment_named
from bilateral_rl.envs.experiments.experiment import is_complete
from bilateral_rl.envs.experiments.files import find_experiment, paradigms
from bilateral_rl.envs.task_specs import ALIASES, PARADIGMS
from bilateral_rl.io.errors import UserError

GOOD = """\
description: everything at once
source: nowhere
start: {hand: [[0.0, 0.4], [0.05, 0.4]]}
target: {center_out: {number: 4, radius: 0.1, first_angle: 45}}
timeline:
  go: [5, 10]
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
  trial_length: 40
  threshold: 0.02
  vision_noise: 0.01
  losses: {dominant: {hand_speed: 0.1}, last_steps: 30}
"""
START, TARGET = "start: {hand: [0.0, 0.4]}\n", "target: {center_out: {}}\n"
HEAD = START + TARGET

ARMS = """\
arms:
  dominant: {start: {hand: [0.1, 0.4]}, target: {center_out: {number: 4}}}
  non_dominant: {start: {hand: [-0.1, 0.4]}, target: start}
"""
LEFT = "  non_dominant: {start: {hand: [-0.1, 0.4]}, target: start}\n"


def left(words):
    return ARMS.replace(LEFT, f"  non_dominant:\n    start: {{hand: [-0.1, 0.4]}}\n{words}")


BROKEN_ARMS = {
    "an arm too few": (ARMS.replace(LEFT, ""), 1, "arms.non_dominant must be given"),
    "an arm of another name": (ARMS.replace("non_dominant", "left"), 3, "Unknown setting 'left' in arms"),
    "an arm without a target": (left(""), 3, "arms.non_dominant.target must be given"),
    "an arm's misspelled field": (left("    targt: start\n"), 5, "you may have meant target"),
    "an arm's cue without effect": (
        left("    target: start\n    timeline: {go: 5}\n"),
        6,
        "arms.non_dominant.timeline has no effect",
    ),
    "an arm's load of nothing": (
        left("    target: start\n    forces: {load: [0, 0]}\n"),
        6,
        "arms.non_dominant.forces.load has no effect at 0",
    ),
    "out of one arm's reach": (
        left("    target: {hand: [0.5, 0.3]}\n"),
        5,
        "arms.non_dominant.target.hand: the position [0.5, 0.3] m is out of the arm's reach, which is from 0.024 to "
        "0.642 m of the shoulder; the shoulder lies at [-0.18, 0] m",
    ),
    "a pulse after the trial": (
        left("    target: start\n    forces:\n      pulse: {force: [1, 0], at: 48, steps: 5}\n"),
        7,
        "arms.non_dominant.forces.pulse must end within the trial of 50 steps",
    ),
    "an unstable field": (
        left("    target: start\n    forces: {curl: 2000}\n"),
        6,
        "arms.non_dominant.forces.curl: in the arm's own frame, a velocity field of [[0, -2000], [2000, 0]]",
    ),
    "both one arm and two": (ARMS + START, 4, "start must stand under arms.dominant and arms.non_dominant"),
    "an exchange of one arm": (HEAD + "exchange: 0.5\n", 3, "exchange has no effect on one arm"),
    "pairs of one arm": (HEAD + "paired: true\n", 3, "paired has no effect on one arm"),
    "pairs of different numbers": (
        left("    target: {center_out: {number: 3}}\n") + "paired: true\n",
        6,
        "paired: needs as many targets of both arms, got 4 and 3",
    ),
    "a spring of one arm": (
        HEAD + "trial: {two_arms: {spring: {stiffness: 50}}}\n",
        3,
        "two_arms has no effect on one",
    ),
    "an unstable spring": (
        ARMS + "trial:\n  two_arms: {spring: {stiffness: 5000}}\n",
        5,
        "trial.two_arms.spring: a spring of 5000 N/m",
    ),
    "roles that the arms have": (ARMS + "trial: {two_arms: {roles: drawn}}\n", 4, "two_arms.roles has no effect where"),
}
BROKEN = {
    **BROKEN_ARMS,
    "tab": (START + "target:\n\tcenter_out: {}\n", 3, "no YAML"),
    "unclosed": ("start: {hand: [0.0, 0.4}\n", 1, "no YAML"),
    "duplicate key": (HEAD + "start: {hand: [0.1, 0.4]}\n", 3, "start is there twice, first in line 1"),
    "duplicate key within": (HEAD + "forces:\n  curl: 1\n  curl: 2\n", 5, "forces.curl is there twice"),
    "unknown field": (HEAD + "colour: red\n", 3, "Unknown setting 'colour' among the settings"),
    "misspelled field": (HEAD + "forces:\n  crul: 10\n", 4, "you may have meant curl"),
    "misspelled place": ("start: {hnd: [0, 0.4]}\n" + TARGET, 1, "you may have meant hand"),
    "no start": (TARGET, 1, "start must be given"),
    "no target": (START, 1, "target must be given"),
    "wrong type": (HEAD + "forces:\n  curl: fast\n", 4, "forces.curl must be a finite number, got 'fast'"),
    "a list for settings": (HEAD + "timeline: [1, 2]\n", 3, "timeline must be settings by name"),
    "a word for a place": ("start: here\n" + TARGET, 1, "start must be settings by name, got 'here'"),
    "another word for the start": (START + "target: strat\n", 2, "Unknown target 'strat'"),
    "three numbers": ("start: {hand: [0.0, 0.4, 0.1]}\n" + TARGET, 1, "start.hand must be two numbers"),
    "one number": ("start: {joints: 1.0}\n" + TARGET, 1, "start.joints must be"),
    "a matrix of another shape": (HEAD + "forces:\n  velocity_field: [1, 2, 3]\n", 4, "matrix of two by two"),
    "NaN": (HEAD + "forces:\n  load: [.nan, 0]\n", 4, "forces.load must be a finite number"),
    "infinite": (HEAD + "forces:\n  curl: .inf\n", 4, "forces.curl must be a finite number"),
    "negative share": (HEAD + "timeline:\n  no_go_share: -0.1\n", 4, "timeline.no_go_share must be at least 0"),
    "share above 1": (HEAD + "timeline:\n  no_go_share: 1.5\n", 4, "timeline.no_go_share must be at most 1"),
    "shares above 1 together": (
        HEAD + "forces:\n  curl: 5\n  field_off_share: 0.6\n  channel: {share: 0.5}\n",
        6,
        "must not be above 1 together",
    ),
    "catch trials of no field": (HEAD + "forces:\n  field_off_share: 0.6\n", 4, "field_off_share needs a field"),
    "jump before go": (
        HEAD + "timeline:\n  go: 10\n  jump: {at: -5, offset: [0, 0.01]}\n",
        5,
        "timeline.jump.at must be at least 0",
    ),
    "no place to jump to": (HEAD + "timeline:\n  jump: {at: 5}\n", 4, "exactly one of target and offset"),
    "steps backwards": (HEAD + "timeline:\n  go: [10, 5]\n", 4, "timeline.go must have the first"),
    "half a step": (HEAD + "timeline:\n  go: 2.5\n", 4, "timeline.go must be a whole number"),
    "go beyond the trial": (HEAD + "timeline:\n  go: [10, 50]\n", 4, "timeline.go must come within the trial of 50"),
    "jump beyond the trial": (
        HEAD + "timeline:\n  go: 30\n  jump: {at: 25, offset: [0, 0.01]}\n",
        5,
        "timeline.jump.at must come within the trial of 50",
    ),
    "pulse outside the trial": (
        HEAD + "forces:\n  pulse: {force: [1, 0], at: 45, steps: 10}\n",
        4,
        "forces.pulse must end within the trial of 50",
    ),
    "pulse without end": (HEAD + "forces:\n  pulse: {force: [1, 0], at: 5}\n", 4, "forces.pulse.steps must be given"),
    "unreachable target": (
        START + "target:\n  hand: [0.0, 0.9]\n",
        3,
        "target.hand: the position [0, 0.9] m is",
    ),
    "unreachable circle": (START + "target: {center_out: {radius: 0.5}}\n", 2, "target.center_out: the position"),
    "unreachable box": (START + "target:\n  hand: {low: [-0.9, 0.2], high: [0.1, 0.5]}\n", 3, "target.hand: the posi"),
    "unreachable disk": (START + "target: {hand: {center: [0, 0.4], radius: 0.4}}\n", 2, "target.hand: the position"),
    "unreachable jump": (HEAD + "timeline:\n  jump: {at: 5, offset: [0, 0.5]}\n", 4, "timeline.jump.offset: the posi"),
    "posture out of the limits": ("start: {joints: [3.0, 1.0]}\n" + TARGET, 1, "start.joints: the posture [3.0, 1.0]"),
    "the other elbow": ("start: {hand: [0, 0.4], elbow: negative}\n" + TARGET, 1, "with a negative elbow"),
    "half a box": (START + "target: {hand: {low: [0, 0.3]}}\n", 2, "a box needs both low and high"),
    "a box upside down": (START + "target: {hand: {low: [0, 0.4], high: [0.1, 0.3]}}\n", 2, "low must not be above hi"),
    "a grid of too many": (
        START + "target: {hand: {low: [0, 0.3], high: [0.1, 0.4], grid: [100, 100]}}\n",
        2,
        "must not have more than 1,000 points, got 10,000",
    ),
    "places beyond count": (
        "start: {hand: {low: [0, 0.3], high: [0.1, 0.4], grid: [30, 30]}}\n"
        "target: {center_out: {number: 900, radius: 0.01}}\ntimeline:\n  jump: {at: 1, offset: [[0, 0], [0, 0.01]]}\n",
        4,
        "timeline.jump.offset: makes more than 1,000,000 places",
    ),
    "two places in one": ("start: {hand: [0, 0.4], joints: uniform}\n" + TARGET, 1, "exactly one of joints, hand and"),
    "center-out around anything": ("start: {joints: uniform}\n" + TARGET, 2, "target.center_out: needs a start"),
    "a start around itself": ("start: {center_out: {}}\ntarget: start\n", 1, "start.center_out.center must be given"),
    "a misspelled target": (START + "targt: start\n", 2, "you may have meant target"),
    "no cue ever": (HEAD + "timeline:\n  no_go_share: 1\n", 4, "no_go_share must be below 1"),
    "a timeline that says nothing": (HEAD + "timeline: {}\n", 3, "timeline says nothing"),
    "a jump in no trial": (HEAD + "timeline:\n  jump: {at: 5, offset: [0, 0.01], share: 0}\n", 4, "has no effect at 0"),
    "a jump to nowhere": (HEAD + "timeline:\n  jump: {at: 5, offset: [0, 0]}\n", 4, "jump.offset has no effect at 0"),
    "forces that say nothing": (HEAD + "forces: {}\n", 3, "forces says nothing"),
    "no load": (HEAD + "forces:\n  load: [0, 0]\n", 4, "forces.load has no effect at 0"),
    "no curl": (HEAD + "forces:\n  curl: 0\n", 4, "forces.curl has no effect at 0"),
    "no stiffness": (HEAD + "forces:\n  elastic_field: {stiffness: 0, center: start}\n", 4, "no effect at 0"),
    "no field": (HEAD + "forces:\n  velocity_field: [[0, 0], [0, 0]]\n", 4, "velocity_field has no effect at 0"),
    "no walls": (HEAD + "forces:\n  channel: {stiffness: 0, damping: 0}\n", 4, "channel.stiffness has no effect at 0"),
    "a channel in no trial": (HEAD + "forces:\n  channel: {share: 0}\n", 4, "channel.share has no effect at 0"),
    "no push": (HEAD + "forces:\n  pulse: {force: {size: 0}, at: 5, steps: 5}\n", 4, "size has no effect at 0"),
    "a pulse of nothing": (
        HEAD + "forces:\n  pulse: {force: [0, 0], at: 5, steps: 5}\n",
        4,
        "force has no effect at 0",
    ),
    "more last steps than steps": (HEAD + "trial:\n  losses: {last_steps: 60}\n", 4, "last_steps must be at most"),
    "a channel that leaves no trial to the field": (
        HEAD + "forces:\n  curl: 5\n  channel: {}\n",
        3,
        "would have no trial with its field",
    ),
    "channel without a way": (START + "target: start\nforces:\n  channel: {}\n", 4, "channel needs a target"),
    "channel to where it starts": (
        START + "target: {hand: [0.0, 0.4]}\nforces:\n  channel: {}\n",
        4,
        "forces.channel: needs targets that are not the start",
    ),
    "unstable walls": (
        HEAD + "forces:\n  channel: {stiffness: 9000, damping: 1}\n",
        4,
        "forces.channel: walls",
    ),
    "unstable field": (HEAD + "forces:\n  curl: 2000\n", 4, "forces.curl: a velocity field of"),
    "unknown setting of trials": (HEAD + "trial:\n  lenght: 3\n", 4, "Unknown setting 'lenght' in trial"),
    "a setting of trials out of range": (HEAD + "trial:\n  threshold: -1\n", 4, "trial.threshold must be above 0"),
    "unknown loss": (
        HEAD + "trial:\n  losses:\n    dominant: {jerk: 1}\n",
        5,
        "Unknown setting 'jerk' in trial",
    ),
    "trial as a number": (HEAD + "trial: 3\n", 3, "trial must be settings by name, got 3"),
    "curl and velocity field": (
        HEAD + "forces:\n  curl: 1\n  velocity_field: [[0, 1], [1, 0]]\n",
        4,
        "give one of the two",
    ),
    "a name that is no folder": ("name: a/b\n" + HEAD, 1, "name must be a word"),
    "the name of a task": ("name: random_reach\n" + HEAD, 1, "name must not be random_reach"),
    "unknown measure": (HEAD + "judged_by: elegance\n", 3, "Unknown judged_by 'elegance'"),
    "empty": ("", 1, "it is empty"),
    "a comment alone": ("# nothing\n", 1, "it is empty"),
    "a list": ("- 1\n- 2\n", 1, "it holds [1, 2]"),
    "an anchor": ("start: &a {hand: [0, 0.4]}\ntarget: *a\n", 2, "refers to parts of itself"),
    "a tag": ("start: !!python/object/apply:os.getcwd []\n", 1, "it has the tag"),
    "too deep": ("start: " + "[" * 50 + "]" * 50 + "\n", 1, "more than 20 levels"),
    "a character that YAML has not": (HEAD + "source: \x00\n", 3, "no YAML"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_file_is_refused_in_one_sentence_that_names_file_and_line_and_field(kind, tmp_path):
    text, line, sentence = BROKEN[kind]
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(ExperimentError) as error:
        experiment_from_file(path)
    assert str(error.value).startswith(f"{path}, line {line}: "), error.value
    assert sentence in str(error.value)
    assert str(error.value).endswith(".")
    assert "\n" not in str(error.value)


def test_files_that_are_none_are_refused(tmp_path):
    for name, content, sentence in (
        ("latin.yaml", HEAD.encode() + "source: Pélisson\n".encode("latin-1"), "line 3: it is not written in UTF-8"),
        ("large.yaml", HEAD.encode() + b"# " + b"x" * 2**17, "larger than anything of its kind"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ExperimentError, match=sentence):
            experiment_from_file(tmp_path / name)
    (tmp_path / "folder.yaml").mkdir()
    with pytest.raises(ExperimentError, match="is a folder"):
        experiment_from_file(tmp_path / "folder.yaml")
    with pytest.raises(ExperimentError, match="There is no experiment"):
        experiment_from_file(tmp_path / "none.yaml")


def test_an_error_is_one_for_people_and_a_value_error():
    assert issubclass(ExperimentError, UserError)
    assert issubclass(ExperimentError, ValueError)


def test_a_file_has_its_name_and_short_forms_become_the_long_ones(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(GOOD)
    experiment = experiment_from_file(path)
    assert experiment.name == "mine"
    assert experiment.timeline.go == (5, 10)
    assert experiment.forces.elastic_field.stiffness == ((20, 0), (0, 20))
    assert experiment.forces.velocity_matrix == ((0, 10), (-10, 0))
    assert experiment.trial["losses"]["last_steps"] == 30
    assert Experiment(**dataclasses.asdict(experiment)) == experiment
    assert is_complete(dataclasses.asdict(experiment))
    path.write_text("name: other\n" + GOOD)
    assert dataclasses.replace(experiment_from_file(str(path)), name="mine") == experiment


def test_the_configuration_of_a_run_is_a_file_of_its_experiment(tmp_path):
    path = tmp_path / "config.yaml"
    inner = dataclasses.asdict(experiment_named("target_jump"))
    path.write_text(yaml.safe_dump(plain({"algo": "ppo", "task": "target_jump", "experiment": inner})))
    assert experiment_from_file(path) == experiment_named("target_jump")
    path.write_text("algo: ppo\nexperiment:\n  name: mine\n  start: {hand: [0, 0.4]}\n  target: {hand: [0, 0.9]}\n")
    with pytest.raises(ExperimentError, match=r"config\.yaml, line 5: target\.hand: the position"):
        experiment_from_file(path)


def test_the_paradigms_that_ship_are_known_by_name_and_say_where_they_come_from():
    assert paradigms().keys() == PARADIGMS.keys()
    for name in PARADIGMS:
        experiment = experiment_named(name)
        assert experiment.name == name
        assert experiment.description
        assert "doi:" in experiment.source
        assert find_experiment(name) is experiment
    assert experiment_named("centre_out") == experiment_named("center_out")
    assert set(ALIASES.values()) <= PARADIGMS.keys()
    with pytest.raises(ExperimentError, match="Unknown experiment 'dance'; choose from center_out"):
        experiment_named("dance")


def test_the_fields_of_the_paradigms_are_those_of_their_sources():
    assert experiment_named("curl_field").forces.velocity_matrix == ((0, 15), (-15, 0))
    assert experiment_named("saddle_field").forces.velocity_matrix == ((-10.1, -11.2), (-11.2, 11.1))


def test_what_stands_under_an_arm_is_what_a_file_of_one_arm_says(tmp_path):
    both = (
        "start: {hand: [0.1, 0.4]}\ntarget: {center_out: {number: 4}}\n"
        + GOOD[GOOD.index("timeline") : GOOD.index("trial:")]
    )
    one, two = tmp_path / "one.yaml", tmp_path / "two.yaml"
    one.write_text(both)
    under = "".join(f"    {line}\n" for line in both.splitlines())
    two.write_text(f"arms:\n  dominant:\n{under}  non_dominant: {{start: {{hand: [-0.1, 0.4]}}, target: start}}\n")
    experiment = experiment_from_file(two)
    assert experiment.assignments["arms.dominant."] == experiment_from_file(one).assignments[""]
    assert experiment.has_field
    assert (experiment.measure, experiment.stays) == ("goal_completion", False)
    values = dataclasses.asdict(experiment)
    assert Experiment(**values) == experiment
    assert is_complete(values)
    assert not is_complete({"name": "x", "arms": {"dominant": values["arms"]["dominant"]}})
    assert not is_complete({"name": "x", "arms": {name: {"forces": {"curl": 1}} for name in values["arms"]}})
