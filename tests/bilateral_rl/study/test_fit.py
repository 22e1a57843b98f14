"""Which readings a study leaves room for."""

import pytest

from bilateral_rl.io.errors import UserError
from bilateral_rl.study.fit import check_fits, readings_for
from bilateral_rl.study.plan import Study
from bilateral_rl.study.readings import load_readings, reading_names


def test_of_all_readings_a_study_by_rewards_takes_those_that_change_neither_training_nor_its_state():
    readings, left_out = readings_for(Study("ppo"), ["all"])
    assert sorted([*(reading.name for reading in readings), *left_out]) == sorted(reading_names())
    kinds = ("penalty", "validation", "load", "continued", "training-trials")
    assert all(any(kind in name for kind in kinds) for name in left_out)
    assert not any(any(kind in reading.name for kind in kinds) for reading in readings)


def test_profile_released_takes_all_but_those_that_set_its_penalty_or_lesions():
    _, left_out = readings_for(Study(profile="released"), ["all"])
    assert left_out
    assert all("penalty" in name or "released-lesions" in name for name in left_out)


def test_a_study_by_bptt_takes_every_reading():
    readings, left_out = readings_for(Study(), ["all"])
    assert [reading.name for reading in readings] == reading_names()
    assert left_out == []


def test_a_reading_that_is_asked_for_by_its_name_is_not_left_out_but_refused():
    study = Study("ppo")
    readings, _ = readings_for(study, ["all", "text-continued"])
    (named,) = load_readings(["text-continued"])
    assert named in readings
    with pytest.raises(UserError, match="text-continued goes on with the training's optimizer"):
        check_fits(named, study)
