"""Lesion studies of small runs, and the same by hand."""

import numpy as np
import pandas as pd

from bilateral_rl.analysis.goals import STUDY_RADII
from bilateral_rl.analysis.metrics import measure, metrics_of
from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.config.parse import merge
from bilateral_rl.config.resolve import resolve
from bilateral_rl.runs.policies import build_network, load_policy, network_states
from bilateral_rl.study.lesioning import LesionSettings, LesionStudy
from bilateral_rl.training.retraining import Retraining

SETTINGS = {"trials": 8, "seed": 7, "threads": 1}
OUTPUT_LAYER = Protocol("output")


def study_of(folder, only=None, weights="final", **settings):
    return LesionStudy(folder, LesionSettings(**{**SETTINGS, **settings}), only, weights)


def run_study(folder, only=None, weights="final", **settings):
    return study_of(folder, only, weights, **settings).run()


def with_config(folder, **values):
    """The run, as if it had been trained with other settings."""
    folder.write_config(resolve(None, None, [merge(folder.config().to_values(), values)]))
    return folder


def values_of(results, **wanted):
    """By metric, of the one state wanted."""
    rows = results[np.logical_and.reduce([results[name] == value for name, value in wanted.items()])]
    assert rows["metric"].is_unique
    return rows.set_index("metric")["value"]


def evaluated(folder, policy, lesion, **settings):
    """The same by hand."""
    config, settings = folder.config(), {**SETTINGS, **settings}
    with policy.motor_network.lesioned(lesion):
        record = Evaluator(config.task, config.trial, settings["trials"], settings["seed"]).run(policy)
    return pd.Series(measure(record, metrics_of(config.task, STUDY_RADII)))


def retrained_by_hand(folder, seed, lesion, trials=None, protocol=OUTPUT_LAYER, state=None, moments=None):
    """The policy of one seed after a protocol, made without the others."""
    config, policy = folder.config(), load_policy(folder, seed=seed)
    layout, state = Layout(build_network(config)), state or network_states(folder)[seed]
    row = Retraining(config, protocol, trials, threads=1).run(layout.pack([state]), [seed], [lesion], moments)
    policy.motor_network.load_state_dict({name: tensor[0] for name, tensor in layout.unpack(row).items()})
    return policy


def assert_same(first, second):
    pd.testing.assert_series_equal(first, second, check_exact=True, check_names=False)
