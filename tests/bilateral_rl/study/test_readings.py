"""Readings of the paper: those that are shipped, files of one's own, and what is refused."""

from pathlib import Path

import pytest
import yaml

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.io.errors import UserError
from bilateral_rl.study.readings import ANCHORS, Radii, load_readings, reading_names

SHIPPED = {reading.name: reading for reading in load_readings(["all"])}
OWN = {"why": "Because.", "source": "Nowhere."}


def write(folder, file="mine.yaml", **values):
    path = folder / file
    path.write_text(yaml.safe_dump(OWN | values))
    return str(path)


def differing(reading):
    """The gaps that a reading fills otherwise than its anchor."""
    anchor = SHIPPED[reading.anchor].choices
    assert reading.choices.keys() == anchor.keys()
    return {name: choice for name, choice in reading.choices.items() if choice != anchor[name]}


def test_the_anchors_come_first_and_are_what_is_judged_by_if_nothing_is_said():
    assert list(SHIPPED)[:2] == [reading.name for reading in load_readings()] == list(ANCHORS)
    text, everything = load_readings()
    assert (text.protocol, everything.protocol) == (Protocol("output"), Protocol("everything"))
    assert text.radii == everything.radii == Radii(0.05, 0.01)
    for anchor in (text, everything):
        assert (anchor.anchor, anchor.training, anchor.measure) == (None, {}, ("completion",))
        assert (anchor.arrival, anchor.alone, anchor.lesions) == ("first", "deep", None)


def test_every_other_reading_deviates_from_an_anchor_by_one_choice():
    deviations = {name: differing(reading) for name, reading in SHIPPED.items() if name not in ANCHORS}
    assert len(deviations) == 41
    assert {len(differences) for differences in deviations.values()} == {1}
    assert deviations["combination"] == {"what adapts": "combination"}
    for anchor in ANCHORS:
        of_anchor = {name.removeprefix(f"{anchor}-"): d for name, d in deviations.items() if name.startswith(anchor)}
        assert of_anchor == {
            "3-epochs": {"epochs after a lesion": "3"},
            "lr-0.01": {"learning rate after a lesion": "0.01"},
            "continued": {"optimizer after a lesion": "continued"},
            "training-trials": {"trials after a lesion": "training"},
            "penalty-weights-0.0001": {"weight penalty": "weights 0.0001"},
            "penalty-activity-0.01": {"weight penalty": "activity 0.01"},
            "penalty-none": {"weight penalty": "none"},
            "validation-1024": {"validation trials": "1024"},
            "load-direction": {"load in hold": "direction"},
            "speed": {"measure of a reach": "speed"},
            "both": {"measure of a reach": "completion and speed"},
            "reach-1cm": {"goal of a reach": "1 cm"},
            "reach-2cm": {"goal of a reach": "2 cm"},
            "reach-3cm": {"goal of a reach": "3 cm"},
            "hold-2cm": {"goal of a hold": "2 cm"},
            "hold-3cm": {"goal of a hold": "3 cm"},
            "hold-5cm": {"goal of a hold": "5 cm"},
            "third-step": {"a reach ends at": "the third step"},
            "released-lesions": {"combined lesions": "released"},
            "alone-shallow": {"a hemisphere alone": "shallow lesion of the other"},
        }


def test_every_reading_says_why_and_from_what_and_is_called_as_its_file():
    for name, reading in SHIPPED.items():
        assert reading.name == name
        assert reading.why.endswith(".")
        assert len(reading.source) > 10
    assert set(SHIPPED) == set(reading_names())


def test_settings_of_one_task_are_not_those_of_the_other():
    reading = SHIPPED["text-load-direction"]
    assert reading.training_of("random_reach") == {}
    assert reading.training_of("hold_position") == {"trial": {"load": "direction"}}
    assert SHIPPED["text-penalty-none"].training_of("random_reach") == {
        "bptt": {"penalty": "weights", "penalty_coefficient": 0.0}
    }


def test_criteria_are_those_of_the_reading():
    criteria = SHIPPED["everything-both"].criteria
    assert (criteria.protocol, criteria.measures) == ("everything", ("completion", "speed"))
    assert SHIPPED["text-hold-3cm"].criteria.radii == {"random_reach": 0.05, "hold_position": 0.03}
    assert SHIPPED["text-alone-shallow"].criteria.alone == "shallow"
    assert SHIPPED["text-third-step"].criteria.arrival == "third"
    assert SHIPPED["everything-3-epochs"].criteria.protocol == "everything-3-epochs"


def test_a_file_of_ones_own_deviates_from_any_that_is_shipped(tmp_path):
    path = write(tmp_path, anchor="everything-speed", radii={"random_reach": 0.02}, protocol={"epochs": 2})
    (mine,) = load_readings([path])
    assert (mine.name, mine.why, mine.anchor) == ("mine", "Because.", "everything-speed")
    assert mine.measure == ("speed",)
    assert mine.protocol == Protocol("everything", epochs=2)
    assert mine.radii == Radii(0.02, 0.01)
    (alone,) = load_readings([write(tmp_path, "alone.yaml", name="other", protocol={"retrain": "none"})])
    assert (alone.name, alone.anchor, alone.criteria.protocol) == ("other", None, "none")


def test_readings_are_loaded_once_and_in_order(tmp_path):
    path = write(tmp_path)
    names = [reading.name for reading in load_readings(["everything", path, "text", path, "everything"])]
    assert names == ["everything", "mine", "text"]


def test_settings_of_a_training_that_are_no_gap_of_the_shipped_readings_are_choices_too(tmp_path):
    (mine,) = load_readings([write(tmp_path, training={"network": {"units": 20}, "hold_position": {"epochs": 5}})])
    assert mine.choices["network.units"] == "20"
    assert mine.choices["epochs"] == "as in the study in random_reach, 5 in hold_position"


def test_a_choice_that_differs_between_tasks_says_what_it_is_in_each(tmp_path):
    tasks = {"random_reach": 0.002, "hold_position": 0.003}
    training = {task: {"bptt": {"penalty_coefficient": value}} for task, value in tasks.items()}
    training["hold_position"]["bptt"]["validation_trials"] = 128
    (mine,) = load_readings([write(tmp_path, training=training)])
    assert mine.choices["weight penalty"] == "0.002 in random_reach, 0.003 in hold_position"
    assert mine.choices["validation trials"] == "as in the study in random_reach, 128 in hold_position"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"why": ""}, "why is missing: say in a sentence"),
        ({"source": " "}, "source is missing"),
        ({"name": "a b"}, "name must be 1 to 60 letters, digits, dots and dashes, got 'a b'"),
        ({"name": "../x"}, "name must be 1 to 60 letters"),
        ({"anchor": "nobody"}, "Unknown reading 'nobody'; choose from"),
        ({"radius": 1}, "Unknown setting 'radius' among the settings; choose from name, why, source, anchor"),
        ({"radii": {"random_reach": 0.04}}, "random_reach must be one of 0.01, 0.02, 0.03, 0.05"),
        ({"radii": {"juggle": 0.05}}, "Unknown setting 'juggle' in radii"),
        ({"measure": ["grace"]}, "Unknown measure 'grace'; choose from completion, speed"),
        ({"measure": []}, "measure must be a list of at least 1"),
        ({"measure": ["speed", "speed"]}, "measure names one measure twice"),
        ({"measure": "speed"}, "measure must be a list, got 'speed'"),
        ({"alone": "none"}, "Unknown alone 'none'; choose from deep, shallow"),
        ({"arrival": "second"}, "Unknown arrival 'second'; choose from first, third"),
        ({"lesions": "paper"}, "Unknown lesions 'paper'; choose from text, released"),
        ({"protocol": {"retrain": "all"}}, "Unknown protocol.retrain 'all'"),
        ({"protocol": {"retrain": "none", "epochs": 3}}, "where nothing is retrained"),
        ({"protocol": "output"}, "protocol must be settings by name"),
        ({"training": "more"}, "training"),
        ({"training": {3: 4}}, "training.[key] must be a word, got 3"),
        ({"training": {"random_reach": 5}}, "training.random_reach must be settings by name, got 5"),
        ({"training": {"hold_position": None}}, "training.hold_position must be settings by name, got None"),
    ],
)
def test_a_file_that_holds_no_reading_is_refused_in_a_sentence(tmp_path, values, message):
    path = write(tmp_path, **values)
    with pytest.raises(UserError) as error:
        load_readings([path])
    assert message in str(error.value)
    assert str(error.value).count("\n") == 0


def test_what_is_no_reading_at_all_is_refused(tmp_path):
    with pytest.raises(
        UserError, match=r"^Unknown reading 'speed'; choose from all, names such as .*text-speed.*, or a"
    ):
        load_readings(["speed"])
    with pytest.raises(UserError, match="Cannot read the configuration"):
        load_readings([str(tmp_path / "nothing.yaml")])
    (tmp_path / "list.yaml").write_text("[1]")
    with pytest.raises(UserError, match="must hold settings by name"):
        load_readings([str(tmp_path / "list.yaml")])


def test_two_readings_of_one_name_are_refused(tmp_path):
    (tmp_path / "b").mkdir()
    paths = [write(tmp_path), write(tmp_path / "b", alone="shallow")]
    with pytest.raises(UserError, match=f"Two readings are called 'mine'; give the one in {paths[1]}"):
        load_readings(paths)
    with pytest.raises(UserError, match="A reading called 'text' is shipped"):
        load_readings([write(tmp_path, "text.yaml")])


def test_every_file_names_only_what_it_changes():
    folder = Path(__file__).parents[3] / "bilateral_rl" / "readings"
    for path in folder.glob("*.yaml"):
        values = yaml.safe_load(path.read_text())
        if "anchor" in values:
            assert len(values) == 5, path.name
