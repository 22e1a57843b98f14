"""Settings of loads and of two arms are refused where they change nothing, but for those of a file."""

import pytest

from bilateral_rl.api import training
from bilateral_rl.config.by_hand import check_by_hand
from bilateral_rl.config.resolve import resolve
from bilateral_rl.io.errors import UserError

LOADS = {"trial": {"load": "direction"}}


@pytest.mark.parametrize("task", ["random_reach", "two_reaches", "curl_field"])
def test_loads_are_refused_in_tasks_without(task):
    with pytest.raises(UserError, match=f"trial.load changes nothing in {task}, which draws no load: leave it out"):
        check_by_hand(LOADS, resolve(None, task, []))


@pytest.mark.parametrize("task", ["hold_position", "two_holds"])
def test_loads_are_taken_in_tasks_with(task):
    check_by_hand(LOADS, resolve(None, task, []))


@pytest.mark.parametrize("chosen", [{"roles": "drawn"}, {"spring": {"stiffness": 0.0}}], ids=["roles", "spring"])
def test_settings_of_two_arms_are_refused_for_one_be_they_as_they_are_anyway(chosen):
    settings = {"trial": {"two_arms": chosen}}
    for task in ("random_reach", "curl_field"):
        with pytest.raises(UserError, match=f"trial.two_arms has no effect on {task}, whose trials have one arm"):
            check_by_hand(settings, resolve(None, task, []))
    check_by_hand(settings, resolve(None, "reach_and_hold", []))


def test_a_file_may_serve_several_tasks_and_what_is_set_by_hand_is_of_one(tmp_path, monkeypatch):
    monkeypatch.setattr(training, "_run", lambda config, *_: config)
    monkeypatch.setattr(training.training, "prepare", lambda config: config)

    def started(*layers):
        return training.start(None, None, None, None, {}, list(layers), tmp_path, False)

    assert started(LOADS, {}).trial.load == "direction"
    with pytest.raises(UserError, match=r"trial\.load changes nothing in random_reach"):
        started({}, LOADS)
