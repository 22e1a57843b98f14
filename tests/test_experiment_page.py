"""What the pages on experiments say is so: their files are experiments, and their names are the code's."""

import re
from pathlib import Path

import pytest

from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.envs.arm.parameters import ArmParameters
from bilateral_rl.envs.experiments.assignment import Cues, TargetJump
from bilateral_rl.envs.experiments.files import experiment_from_file
from bilateral_rl.envs.experiments.forces import ElasticField, Forces
from bilateral_rl.envs.stability import check_stability
from bilateral_rl.envs.task_specs import PARADIGMS
from bilateral_rl.envs.tasks import HandForces

DOCS = Path(__file__).parents[1] / "docs"
TEXT, FORCES = ((DOCS / f"{page}.md").read_text(encoding="utf-8") for page in ("experiments", "forces"))
FILES = re.findall(r"```yaml\n# (\S+)\n(.*?)```", TEXT, re.DOTALL)


@pytest.mark.parametrize(("name", "text"), FILES, ids=[name for name, _ in FILES])
def test_a_file_in_the_page_is_an_experiment(name, text, tmp_path):
    (tmp_path / name).write_text(text, encoding="utf-8")
    experiment = experiment_from_file(tmp_path / name)
    assert experiment.name == name.removesuffix(".yaml")


def test_there_is_a_short_file_and_one_with_every_feature(tmp_path):
    assert [name for name, _ in FILES] == ["near.yaml", "study.yaml", "bread.yaml"]
    path = tmp_path / "study.yaml"
    path.write_text(FILES[1][1], encoding="utf-8")
    experiment = experiment_from_file(path)
    for section, without in ((experiment.timeline, ()), (experiment.forces, ("velocity_field",))):
        given = {name for name in section.__dataclass_fields__ if getattr(section, name) not in (None, 0.0)}
        assert given == {*section.__dataclass_fields__} - {*without}


def test_every_entry_of_timeline_and_forces_has_its_row():
    shown = set(re.findall(r"`([\w.]+)`", TEXT))
    assert set(Forces.__dataclass_fields__) <= shown
    assert {name for name in Cues.__dataclass_fields__ if name != "jump"} <= shown
    assert {f"jump.{name}" for name in TargetJump.__dataclass_fields__} <= shown
    assert set(ElasticField.__dataclass_fields__) <= shown
    assert {"arms", "exchange", "paired"} <= shown


def test_the_paradigms_are_those_that_ship():
    assert dict(re.findall(r"^\| `(\w+)` \|[^|]*\| `(bilateral_rl/\S+)` \|$", TEXT, re.MULTILINE)) == PARADIGMS


def test_metrics_have_the_units_that_the_page_says():
    rows = re.findall(r"^\| (`\w+`(?:, `\w+`)*) \|([^|]*)\|", FORCES, re.MULTILINE)
    assert len(rows) >= 10
    for names, units in rows:
        for name, unit in zip(re.findall(r"\w+", names), units.split(","), strict=True):
            assert find_metric(name).unit == unit.strip(), name


def hand_forces(curl=0.0, stiffness=0.0, walls=(0.0, 0.0)):
    zeros = [[0.0, 0.0]]
    return HandForces([[[0.0, curl], [-curl, 0.0]]], [[[stiffness, 0], [0, stiffness]]], zeros, zeros, zeros, [walls])


@pytest.mark.parametrize(
    ("allowed", "refused"),
    [
        ({"curl": 28.0}, {"curl": 29.0}),
        ({"stiffness": 340.0}, {"stiffness": 350.0}),
        ({"walls": (1000.0, 10.5)}, {"walls": (1000.0, 9.5)}),
        ({"walls": (1000.0, 175.0)}, {"walls": (1000.0, 176.0)}),
    ],
)
def test_bounds_of_forces_are_those_that_the_page_says(allowed, refused):
    check_stability(hand_forces(**allowed), ArmParameters())
    with pytest.raises(ValueError, match="swing"):
        check_stability(hand_forces(**refused), ArmParameters())
