"""Settings of loads are refused where they change nothing, but for those of a file."""

import pytest

from bilateral_rl.api import training
from bilateral_rl.config.loads import check_loads
from bilateral_rl.config.resolve import resolve
from bilateral_rl.io.errors import UserError

LOADS = {"trial": {"load": "direction"}}


@pytest.mark.parametrize("task", ["random_reach", "two_reaches", "curl_field"])
def test_loads_are_refused_in_tasks_without(task):
    with pytest.raises(UserError, match=f"trial.load changes nothing in {task}, which draws no load: leave it out"):
        check_loads(LOADS, resolve(None, task, []))


@pytest.mark.parametrize("task", ["hold_position", "two_holds"])
def test_loads_are_taken_in_tasks_with(task):
    check_loads(LOADS, resolve(None, task, []))


def test_a_file_may_serve_several_tasks_and_what_is_set_by_hand_is_of_one(tmp_path, monkeypatch):
    monkeypatch.setattr(training, "_run", lambda config, *_: config)
    monkeypatch.setattr(training.training, "prepare", lambda config: config)

    def started(*layers):
        return training.start(None, None, None, None, {}, list(layers), tmp_path, False)

    assert started(LOADS, {}).trial.load == "direction"
    with pytest.raises(UserError, match=r"trial\.load changes nothing in random_reach"):
        started({}, LOADS)
