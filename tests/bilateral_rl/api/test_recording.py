"""Recordings from Python are those of the command; what is in them is tested in analysis."""

import numpy as np
import pandas as pd
import pytest

import bilateral_rl as brl

GIVEN = {"seed": 3, "lesion": ["intact", "callosum"], "settings": {"trial.sensory_noise": 0.01}}


def test_a_recording_is_kept_or_written_as_by_the_command(loaded, call, tmp_path):
    one = brl.load(loaded, seed=1)
    recording = one.record(4, **GIVEN, progress=False)
    assert len(recording) == 2 * 4
    assert recording["hand"].shape == (8, 21, 2)
    options = ["--trials", 4, "--seed", 3, "--lesion", "intact", "--lesion", "callosum"]
    code, *_ = call("record", one.name, *options, "--set", "trial.sensory_noise=0.01", "--out", "command.csv")
    assert code == 0
    assert one.record_to(tmp_path / "python.csv", 4, **GIVEN, progress=False) == tmp_path / "python.csv"
    assert (tmp_path / "python.csv").read_bytes() == (tmp_path / "command.csv").read_bytes()
    frame = pd.read_csv(tmp_path / "python.csv", comment="#")
    np.testing.assert_allclose(frame["hand_x_m"], recording.frame()["hand_x_m"], rtol=1e-5)


def test_tests_under_other_conditions_say_so(loaded):
    table = loaded.evaluate(4, task="hold_position", settings={"trial": {"max_load": 5.0}}, by="trial")
    assert set(table["task"]) == {"hold_position"}
    assert set(table["trial.max_load"]) == {5.0}
    assert table["load_x_N"].abs().max() <= 5
    with pytest.warns(UserWarning, match="A step is 20 ms here and was 10 ms in the training") as warned:
        loaded.evaluate(2, settings={"trial.arm.timestep": 0.02})
    assert warned[0].filename == __file__
