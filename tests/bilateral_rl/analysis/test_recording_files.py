"""Recordings as files: the same numbers in every format, and never half a file."""

import json
import sys

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from everything import EVERYTHING
from pyarrow import parquet

from bilateral_rl.analysis import recording_of_trials
from bilateral_rl.analysis.conditions import conditions
from bilateral_rl.analysis.recording import Recording
from bilateral_rl.analysis.recording_files import WRITERS, side_file, write
from bilateral_rl.analysis.recording_of_trials import record
from bilateral_rl.config.resolve import resolve
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import LESIONS, NO_LESION
from bilateral_rl.runs.policies import build_policy

METADATA = {"run": "runs/über", "seeds": [0, 1], "changed": {"trial.max_load": 3.0}}
ENDINGS = list(WRITERS)


@pytest.fixture(scope="module", params=["the paper's hold", "an experiment"])
def two(request):
    """Two networks, intact and lesioned: four times three trials of ten or more steps."""
    config = resolve(None, "hold_position", [{"trial": {"trial_length": 10}}])
    under = conditions(config)
    if request.param == "an experiment":
        under = conditions(config, str(EVERYTHING))
    policies = {seed: build_policy(config) for seed in (0, 1)}
    lesions = {"intact": NO_LESION, "callosum": LESIONS["callosum"]}

    def parts():
        return record(policies, lesions, under, 3, 0, METADATA)

    return parts


@pytest.fixture(scope="module")
def whole(two):
    return Recording.join(two())


@pytest.fixture
def written(two, whole, tmp_path, monkeypatch):
    """Writes a recording in parts of two trials, and returns the file."""

    def make(ending):
        monkeypatch.setattr(recording_of_trials, "TRIALS_AT_ONCE", 2)
        path = tmp_path / f"data{ending}"
        write(path, two(), len(whole))
        return path

    return make


def check_table(table, whole, tolerance=1e-3):
    frame = whole.frame()
    assert list(table) == list(frame)
    for name in frame:
        if frame[name].dtype.kind == "f":
            np.testing.assert_allclose(table[name], frame[name], atol=tolerance, err_msg=name)
        else:
            assert table[name].tolist() == frame[name].tolist()


def test_csv_is_read_by_pandas_without_options_and_explained_beside_it(written, whole):
    path = written(".csv")
    check_table(pd.read_csv(path), whole)
    beside = json.loads(side_file(path).read_text(encoding="utf-8"))
    assert beside["run"] == "runs/über"
    assert beside["fields"]["muscle_force"]["unit"] == "N"
    assert beside["names"]["muscle"][0] == "pectoralis"


def test_csv_has_all_digits_of_its_numbers(whole, tmp_path):
    whole.save(tmp_path / "data.csv")
    table, frame = pd.read_csv(tmp_path / "data.csv"), whole.frame()
    numbers = frame.select_dtypes("float32")
    np.testing.assert_allclose(table[list(numbers)], numbers, rtol=1e-6)


def test_npz_has_an_array_a_field_and_is_read_without_pickle(written, whole):
    with np.load(written(".npz"), allow_pickle=False) as file:
        assert set(file) == {*whole.arrays, "time", "metadata"}
        for name, values in whole.arrays.items():
            assert file[name].dtype == values.dtype
            if values.dtype.kind == "f":
                np.testing.assert_allclose(file[name], values, atol=1e-3, err_msg=name)
            else:
                np.testing.assert_array_equal(file[name], values)
        np.testing.assert_array_equal(file["time"], whole.time)
        said = json.loads(str(file["metadata"]))
    assert said["fields"]["hidden"]["dimensions"] == ["trial", "step", "layer", "side", "unit"]
    assert said["changed"] == {"trial.max_load": 3.0}


def test_parquet_has_the_table_with_units_and_metadata(written, whole):
    path = written(".parquet")
    check_table(pd.read_parquet(path), whole)
    schema = parquet.read_schema(path)
    assert schema.field("muscle_force_biceps_N").metadata[b"unit"] == b"N"
    assert json.loads(schema.metadata[b"bilateral_rl"])["run"] == "runs/über"


def test_netcdf_has_names_along_its_dimensions_and_units(written, whole):
    with xr.open_dataset(written(".nc")) as data:
        for name, values in whole.arrays.items():
            assert data[name].dims == ("trial", *next(f.dims for f in whole.fields if f.name == name))
            if values.dtype.kind == "f":
                np.testing.assert_allclose(data[name], values, atol=1e-3, err_msg=name)
            else:
                assert data[name].values.tolist() == values.tolist()
        assert data.muscle_force.attrs["units"] == "N"
        elbow = data.joint_angle.sel(joint="elbow", time=0.05, method=None)
        np.testing.assert_allclose(elbow, whole["joint_angle"][:, 5, 1], atol=1e-3)
        assert data.attrs["run"] == "runs/über"
        assert json.loads(data.attrs["changed"]) == {"trial.max_load": 3.0}
        assert data.attrs["timestep_s"] == 0.01
        assert data.hand.sel(trial=2, axis="x").shape == (4, len(whole.time))  # of both networks with both lesions


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_same_recording_makes_the_same_file(whole, tmp_path, ending):
    first, second = tmp_path / f"a{ending}", tmp_path / f"b{ending}"
    whole.save(first)
    whole.save(second)
    if ending == ".npz":  # a zip holds the time of day
        first, second = first.stat().st_size, second.stat().st_size
        assert first == second
    else:
        assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_file_that_cannot_be_written_leaves_the_earlier_one(whole, tmp_path, ending):
    resource = pytest.importorskip("resource")  # not on Windows
    path = tmp_path / f"data{ending}"
    path.write_text("earlier")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    try:
        with pytest.raises(UserError, match="Cannot write"):
            whole.save(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_text() == "earlier"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("ending", ENDINGS)
def test_trials_that_fail_leave_nothing(two, whole, tmp_path, ending):
    def broken():
        yield next(two())
        raise UserError("diverged")

    with pytest.raises(UserError, match="diverged"):
        write(tmp_path / f"data{ending}", broken(), len(whole))
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_a_recording_is_refused_at_once(whole, tmp_path):
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "beside.csv.json").mkdir()
    for name, says in {
        "data.xlsx": "ends in .csv, .npz, .parquet, .nc",
        "data": "ends in",
        "folder.csv": "folder.csv is not a regular file",
        "beside.csv": "beside.csv.json is not a regular file",
        "nowhere/data.npz": "No such file",
        "/proc/data.csv": "Cannot write",
    }.items():
        with pytest.raises(UserError, match=says):
            whole.save(tmp_path / name)


@pytest.mark.parametrize(("ending", "library"), [(".parquet", "pyarrow"), (".nc", "netCDF4")])
def test_a_missing_library_is_named_with_its_extra(whole, tmp_path, monkeypatch, ending, library):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(UserError, match=rf'{library}.*-e "\.\[record\]"'):
        whole.save(tmp_path / f"data{ending}")
