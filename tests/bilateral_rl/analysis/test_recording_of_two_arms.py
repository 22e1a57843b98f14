"""Recordings of two arms: in the frame of the body, by arm, and of one hand alone as of one arm."""

import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from pyarrow import parquet
from two_arm_recordings import SEED, STEPS, TRIALS, two_arms

from bilateral_rl.analysis.recording_files import side_file
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.envs.body_frame import in_body_frame, vectors_between_frames
from bilateral_rl.envs.kinematics import hand_position, hand_velocity
from bilateral_rl.io.errors import UserError
from bilateral_rl.vocabulary import SIDES

APART = 0.36


@pytest.fixture(scope="module")
def recording():
    return two_arms().recording


@pytest.fixture(scope="module")
def measured():
    """The same trials as they are measured, a row a hand."""
    made = two_arms()
    return Evaluator("reach_and_hold", made.under.settings, TRIALS, SEED).run(made.policy)


def test_hands_are_where_the_angles_put_them_in_the_frame_of_the_body(recording):
    own = hand_position(recording["joint_angle"], two_arms().under.settings.arm)
    np.testing.assert_allclose(recording["hand"], in_body_frame(own, APART), atol=1e-5)
    assert recording["hand"].shape == (TRIALS, STEPS + 1, 2, 2)
    assert (recording["hand"][:, 0, 0, 0] > 0.04).all()  # either hand starts on its own side of the midline
    assert (recording["hand"][:, 0, 1, 0] < -0.04).all()
    velocity = hand_velocity(recording["joint_angle"], recording["joint_velocity"], two_arms().under.settings.arm)
    np.testing.assert_allclose(recording["hand_velocity"], vectors_between_frames(velocity), atol=1e-5)
    assert np.abs(velocity).max() > 0.5


def test_the_spring_pulls_the_hands_toward_each_other_and_is_the_force_on_them(recording):
    force, hand = recording["spring_force"], recording["hand"].astype(np.float64)
    np.testing.assert_allclose(force.sum(axis=2), 0, atol=1e-5)
    apart, rate = (np.subtract(of[:, :, 1], of[:, :, 0]) for of in (hand, recording["hand_velocity"]))
    expected = 50 * (apart - apart[:, :1]) + 2 * rate
    np.testing.assert_allclose(force[:, :, 0], expected, atol=1e-3)
    np.testing.assert_allclose(recording["force"], force[:, :-1] + recording["load"][:, None], atol=1e-3)
    assert np.abs(force).max() > 0.5


def test_every_second_trial_has_the_arms_exchanged(recording):
    first, second = (recording["hand"][i::2, 0] for i in (0, 1))
    np.testing.assert_allclose(second, first[:, ::-1] * (-1, 1), atol=1e-6)
    np.testing.assert_allclose(recording["target"][1::2], recording["target"][::2, ::-1] * (-1, 1), atol=1e-6)
    np.testing.assert_array_equal(recording["role"][1::2], recording["role"][::2, ::-1])
    assert {*recording["role"].ravel()} == {"reach", "hold"}
    assert recording["trial"].tolist() == [0, 1, 2, 3]


def test_contributions_to_each_arm_lead_to_its_excitations(recording):
    network = two_arms().policy.motor_network
    for arm, side in enumerate(SIDES):
        bias = network.output[side].bias.detach().numpy()
        z = recording["contribution"][:, :, :, arm].sum(axis=2) + bias
        np.testing.assert_allclose(recording["excitation"][:, :, arm], 1 / (1 + np.exp(-z)), atol=1e-5)


def test_what_was_seen_of_each_arm_is_in_its_own_frame(recording):
    view = recording["observation"]
    assert view.shape == (TRIALS, STEPS, 2, 20)
    own = in_body_frame(view[..., 12:14], APART)
    np.testing.assert_allclose(own, recording["hand"][:, :-1], atol=1e-5)
    names = dict(zip(recording.columns(), recording.rows()[2, 5], strict=True))
    assert names["observation_non_dominant_own_target_x_m"] == view[2, 5, 1, 16]
    assert names["observation_dominant_other_hand_y_m"] == view[2, 5, 0, 15]


@pytest.mark.parametrize("arm", [0, 1])
def test_one_hand_is_what_is_measured_in_the_frame_of_its_own_arm(recording, measured, arm):
    hand = recording.of_hand(SIDES[arm])
    assert (hand.n_arms, recording.n_arms) == (1, 2)
    for name in ("hand", "target", "seen_target", "force", "excitation", "load", "spring_force"):
        np.testing.assert_allclose(hand[name], getattr(measured, name)[arm::2], atol=1e-5, err_msg=name)
    np.testing.assert_array_equal(hand["joint_angle"], measured.joint[arm::2])
    np.testing.assert_array_equal(hand["observation"], measured.observation[arm::2])
    assert hand.frame().columns[:6].tolist() == ["seed", "lesion", "trial", "role", "step", "time_s"]
    assert {"hand_x_m", "contribution_dominant_biceps", "observation_own_hand_x_m"} <= {*hand.columns()}
    position = next(field for field in hand.fields if field.name == "hand")
    assert position.description == "position of the hand, the shoulder at the origin"


def test_one_hand_in_one_role_has_those_trials_alone(recording):
    holds = recording.of_hand("dominant", "hold")
    rows = recording["role"][:, 0] == "hold"
    assert 0 < len(holds) == rows.sum() < TRIALS
    assert holds["trial"].tolist() == recording["trial"][rows].tolist()
    for wrong, says in (
        (lambda: recording.of_hand("left"), "no 'left' hand; choose from dominant, non_dominant"),
        (lambda: recording.of_hand("dominant", "push"), "no role 'push' here; choose from hold, reach"),
        (lambda: holds.of_hand("dominant"), "use it as it is"),
    ):
        with pytest.raises(UserError, match=says):
            wrong()


def test_fields_say_what_frame_they_are_in(recording):
    for field in recording.fields:
        words = "arm's own frame" if field.name in ("joint_angle", "observation") else "in the frame of the body"
        assert (words in field.description) == (field.frame != "none"), field.name
        assert "the shoulder at the origin" not in field.description or field.frame == "own"
    columns = recording.columns()
    assert len(set(columns)) == len(columns)
    assert {"hand_non_dominant_x_m", "distance_dominant_m", "muscle_force_dominant_biceps_N"} <= {*columns}


def test_files_have_the_arms(recording, tmp_path):
    for ending in (".csv", ".npz", ".parquet", ".nc"):
        recording.save(tmp_path / f"data{ending}")
    frame = recording.frame()
    for table in (pd.read_csv(tmp_path / "data.csv"), pd.read_parquet(tmp_path / "data.parquet")):
        assert list(table) == list(frame)
        np.testing.assert_allclose(table["hand_non_dominant_y_m"], frame["hand_non_dominant_y_m"], atol=1e-6)
        assert table["role_dominant"].tolist() == frame["role_dominant"].tolist()
    assert json.loads(side_file(tmp_path / "data.csv").read_text())["names"]["arm"] == [*SIDES]
    assert (
        b"frame of the body"
        in parquet.read_schema(tmp_path / "data.parquet").field("hand_dominant_x_m").metadata[b"description"]
    )
    with np.load(tmp_path / "data.npz", allow_pickle=False) as file:
        np.testing.assert_array_equal(file["role"], recording["role"])
    with xr.open_dataset(tmp_path / "data.nc") as data:
        hand = data.hand.sel(arm="non_dominant", axis="x")
        np.testing.assert_array_equal(hand, recording["hand"][:, :, 1, 0])
        assert data.role.sel(arm="dominant").values.tolist() == recording["role"][:, 0].tolist()
