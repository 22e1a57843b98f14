"""Recordings: against the arm's own equations, the network's, and the measures of the same trials."""

import copy
import dataclasses
import pickle

import numpy as np
import pandas as pd
import pytest
import torch

from bilateral_rl.analysis import recording_of_trials as module
from bilateral_rl.analysis.conditions import conditions
from bilateral_rl.analysis.recording import Recording
from bilateral_rl.analysis.recording_fields import EVERY_FIELD, LABEL_FIELDS
from bilateral_rl.analysis.recording_of_trials import record
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.config.resolve import resolve
from bilateral_rl.envs import Arm
from bilateral_rl.envs.arm.physics import FORCE, LENGTH, VELOCITY
from bilateral_rl.policies.lesions import LESIONS, NO_LESION
from bilateral_rl.policies.motor_network import MotorNetwork
from bilateral_rl.policies.networks import UnilateralNetwork
from bilateral_rl.runs.policies import build_policy
from bilateral_rl.vocabulary import SIDES

SETTINGS = {"trial": {"trial_length": 12}}


@pytest.fixture
def make(request):
    """Builder of recordings of random networks."""

    def make(model="cc_s", task="hold_position", lesion="intact", trials=5, seed=3, seeds=(0,), noise=0, **settings):
        config = resolve(None, task, [SETTINGS | {"network": {"hidden_noise": noise}}], model=model)
        policies = {}
        for number in seeds:
            torch.manual_seed(number)
            policies[number] = build_policy(config)
            with torch.no_grad():
                for parameter in policies[number].motor_network.parameters():
                    parameter += 0.3 * torch.randn(parameter.shape)
        lesions = {lesion: LESIONS.get(lesion, NO_LESION)}
        under = conditions(config, None, {"trial": settings} if settings else None)
        whole = Recording.join(record(policies, lesions, under, trials, seed, {"run": "somewhere"}))
        return whole, policies, under

    return make


def test_states_follow_the_equations_of_the_arm(make):
    recording, _, under = make()
    arm = Arm(under.settings.arm, dtype=torch.float64)
    state = arm.rest(torch.from_numpy(recording["joint_angle"][:, 0]))
    load = torch.from_numpy(recording["load"])
    assert recording["load"].any()
    for moment in range(13):
        for name, expected, tolerance in (
            ("joint_angle", state.joint[:, :2], 1e-5),
            ("joint_velocity", state.joint[:, 2:], 1e-3),
            ("hand", state.cartesian[:, :2], 1e-5),
            ("hand_velocity", state.cartesian[:, 2:], 1e-3),
            ("activation", state.muscle[:, 0], 1e-5),
            ("muscle_length", state.muscle[:, LENGTH], 1e-5),
            ("muscle_velocity", state.muscle[:, VELOCITY], 1e-3),
            ("muscle_force", state.muscle[:, FORCE], 0.5),
        ):
            np.testing.assert_allclose(recording[name][:, moment], expected, atol=tolerance, err_msg=name)
        if moment < 12:
            state = arm.step(state, torch.from_numpy(recording["excitation"][:, moment]), load)
    assert np.abs(recording["hand_velocity"]).max() > 0.1


def test_a_recording_is_of_the_trials_that_are_measured(make):
    recording, policies, under = make(sensory_noise=0.01, feedback_delay=2)
    measured = Evaluator(under.task, under.settings, 5, 3).run(policies[0])
    for name in ("hand", "target", "load", "observation", "excitation"):
        np.testing.assert_array_equal(recording[name], getattr(measured, name))
    np.testing.assert_array_equal(recording["joint_angle"], measured.joint)
    np.testing.assert_array_equal(recording["activation"][:, 1:], measured.activation)
    np.testing.assert_array_equal(recording["distance"][:, 1:], measured.distance)
    np.testing.assert_array_equal(recording["distance"][:, 0], measured.start_distance)
    np.testing.assert_allclose(recording["reward"].sum(axis=1), measured.vector_return, rtol=1e-5)
    assert [
        (f.name, recording[f.name].dtype) for f in recording.quantities if recording[f.name].dtype != "float32"
    ] == []


@pytest.mark.parametrize("lesion", ["intact", "shallow_dominant", "deep_non_dominant", "callosum_deep_dominant"])
def test_hidden_activity_leads_to_the_excitations(make, lesion):
    recording, policies, _ = make(lesion=lesion)
    network = policies[0].motor_network
    hidden, observation = recording["hidden"].astype(float), recording["observation"].astype(float)
    assert hidden.shape == (5, 12, 2, 2, 5)
    for i, side in enumerate(SIDES):
        first = getattr(network, side)[0]
        seen = 0 * observation if lesion == f"shallow_{side}" else observation
        expected = np.tanh(seen @ first.weight.detach().numpy().T.astype(float) + first.bias.detach().numpy())
        np.testing.assert_allclose(hidden[:, :, 0, i], expected, atol=1e-5)
        weight = 0.0 if lesion.endswith(f"deep_{side}") else network.combination_weights()[side]
        added = weight * hidden[:, :, 1, i] @ network.output.weight.detach().numpy().T
        np.testing.assert_allclose(recording["contribution"][:, :, i], added, atol=1e-5)
        assert hidden[:, :, 1, i].any()  # a side with a deep lesion is still active
    z = recording["contribution"].sum(axis=2) + network.output.bias.detach().numpy()
    np.testing.assert_allclose(recording["excitation"], 1 / (1 + np.exp(-z)), atol=1e-5)


def test_the_second_layer_has_its_own_activity_and_what_the_callosum_brings(make):
    recording, policies, _ = make()
    network = policies[0].motor_network
    own, other = recording["hidden"][0, 7, 0].astype(float)
    own[3:] += [max(other[0], other[1]), max(other[2], other[3])]  # the odd last unit is dropped
    layer = network.dominant[1]
    expected = np.tanh(layer.weight.detach().numpy() @ own + layer.bias.detach().numpy())
    np.testing.assert_allclose(recording["hidden"][0, 7, 1, 0], expected, atol=1e-5)


def test_noise_of_hidden_units_is_recorded_and_the_same_in_every_recording(make):
    recording, policies, _ = make(noise=0.2)
    again, alone = make(noise=0.2)[0], make(noise=0.2, trials=1, seed=5)[0]
    for name, values in recording.arrays.items():
        np.testing.assert_array_equal(values, again[name], err_msg=name)
    np.testing.assert_allclose(
        recording["hidden"][2:3], alone["hidden"], atol=1e-5
    )  # trial 2 of seed 3 is trial 0 of 5
    bias = policies[0].motor_network.output.bias.detach().numpy()
    excitation = 1 / (1 + np.exp(-(recording["contribution"].sum(axis=2) + bias)))
    np.testing.assert_allclose(recording["excitation"], excitation, atol=1e-5)
    assert not np.allclose(make()[0]["hidden"], recording["hidden"], atol=0.05)


def test_a_network_without_sides_has_layers_of_all_its_units_and_no_contributions(make):
    recording, policies, _ = make(model="uni_b")
    assert recording["hidden"].shape == (5, 12, 2, 10)
    assert "contribution" not in recording.arrays
    output = policies[0].motor_network.output
    z = recording["hidden"][:, :, 1] @ output.weight.detach().numpy().T + output.bias.detach().numpy()
    np.testing.assert_allclose(recording["excitation"], 1 / (1 + np.exp(-z)), atol=1e-5)
    assert "hidden_layer2_unit10" in recording.columns()


def test_a_network_of_ones_own_that_tells_no_hidden_layers_is_recorded_without(make, monkeypatch):
    monkeypatch.setattr(UnilateralNetwork, "forward", lambda network, observation, noise: observation[..., :6])
    monkeypatch.setattr(UnilateralNetwork, "hidden_layers", MotorNetwork.hidden_layers)
    recording, _, _ = make(model="uni_b")
    assert "hidden" not in recording.arrays
    assert len(recording.frame()) == 5 * 13


def test_a_recording_is_copied_sent_to_other_processes_and_named_in_a_line(make):
    recording, _, _ = make()
    for copied in (pickle.loads(pickle.dumps(recording)), copy.deepcopy(recording)):
        assert copied.fields == recording.fields
        pd.testing.assert_frame_equal(copied.frame(), recording.frame())
    assert repr(recording).startswith("<Recording of 5 trials of 12 steps: joint_angle, joint_velocity, hand,")


def test_a_table_has_a_row_for_each_trial_and_moment_and_units_in_its_columns(make):
    recording, _, _ = make(seeds=(0, 4), trials=3)
    table = recording.frame()
    assert len(table) == 2 * 3 * 13
    assert list(table.columns[:5]) == ["seed", "lesion", "trial", "step", "time_s"]
    row = table[(table.seed == 4) & (table.trial == 2) & (table.step == 7)].squeeze()
    assert row["time_s"] == pytest.approx(0.07)
    for column, value in {
        "lesion": "intact",
        "joint_angle_elbow_rad": recording["joint_angle"][5, 7, 1],
        "joint_velocity_shoulder_rad_per_s": recording["joint_velocity"][5, 7, 0],
        "hand_y_m": recording["hand"][5, 7, 1],
        "distance_m": recording["distance"][5, 7],
        "muscle_force_triceps_lateral_N": recording["muscle_force"][5, 7, 3],
        "observation_hand_x_m": recording["observation"][5, 7, 12],
        "excitation_biceps": recording["excitation"][5, 7, 4],
        "reward_non_dominant": recording["reward"][5, 7, 1],
        "hidden_layer2_non_dominant_unit3": recording["hidden"][5, 7, 1, 1, 2],
        "contribution_dominant_deltoid": recording["contribution"][5, 7, 0, 1],
        "load_x_N": recording["load"][5, 0],
    }.items():
        assert row[column] == value, column
    last = table[table.step == 12]
    assert last.filter(regex="^(observation|excitation|reward|hidden_layer|contribution)").isna().all(axis=None)
    assert last.filter(regex="^(joint|hand_|distance|activation|muscle|target|load)").notna().all(axis=None)


def test_parts_make_the_same_whole(make, monkeypatch):
    whole, _, _ = make(trials=5, seeds=(0, 1))
    monkeypatch.setattr(module, "TRIALS_AT_ONCE", 2)
    parts, _, _ = make(trials=5, seeds=(0, 1))
    assert list(whole.arrays) == list(parts.arrays)
    for name, values in whole.arrays.items():
        if values.dtype.kind == "f":
            np.testing.assert_allclose(parts[name], values, atol=1e-3, err_msg=name)
        else:
            np.testing.assert_array_equal(parts[name], values)


def test_long_trials_and_large_networks_are_fewer_at_once():
    config = resolve(None, None, [])
    network = build_policy(config).motor_network
    assert module.trials_at_once(network, config.trial) == module.TRIALS_AT_ONCE
    long = dataclasses.replace(config.trial, trial_length=10_000)
    assert 1 <= module.trials_at_once(network, long) < 20
    late = dataclasses.replace(config.trial, feedback_delay=10_000)
    assert 1 <= module.trials_at_once(network, late) < 200


def test_every_field_is_explained_and_named_once(make):
    for field in EVERY_FIELD:
        assert field.description
        assert field.description[0].islower()
    columns = make()[0].columns()
    assert len(set(columns)) == len(columns)
    assert [field.name for field in LABEL_FIELDS] == ["seed", "lesion", "trial", "condition", "target_index", "role"]
