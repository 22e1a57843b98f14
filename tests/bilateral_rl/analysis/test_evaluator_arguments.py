"""Every argument of an Evaluator: another value shows in its trials."""

import inspect

import numpy as np
import pytest
import torch
from gymnasium import spaces

from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.envs import TrialSettings
from bilateral_rl.policies import BilateralPolicy

PLAIN = {"task": "random_reach", "settings": TrialSettings(trial_length=3), "trials": 2, "seed": 5}
OTHERS = {"task": "hold_position", "settings": TrialSettings(trial_length=4), "trials": 3, "seed": 6}


@pytest.fixture(scope="module")
def policy():
    return BilateralPolicy(spaces.Box(-1, 1, (16,)), spaces.Box(-1, 1, (6,)), lambda _: 0.0)


def test_every_argument_shows(policy):
    assert inspect.signature(Evaluator).parameters.keys() - {"device"} == OTHERS.keys()

    def hand(**arguments):
        return repr(Evaluator(**(PLAIN | arguments)).run(policy).hand)

    assert hand() == hand()
    for name, value in OTHERS.items():
        assert hand(**{name: value}) != hand(), name
    assert hand(trials=np.int64(2), seed=np.int64(5), device=torch.device("cpu")) == hand()
    with pytest.raises((ValueError, RuntimeError), match="nowhere"):
        Evaluator(**PLAIN, device="nowhere")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"trials": 0}, "at least 1|at least one"),
        ({"trials": 2.5}, "whole number"),
        ({"seed": -1}, "seed must be at least 0"),
        ({"seed": "a"}, "seed must be a whole number"),
        ({"settings": {"trial_length": 3}}, "TrialSettings"),
        ({"task": "reach"}, "[Uu]nknown task 'reach'"),
    ],
)
def test_what_it_cannot_do_is_refused(arguments, message):
    with pytest.raises((ValueError, TypeError), match=message):
        Evaluator(**(PLAIN | arguments))
