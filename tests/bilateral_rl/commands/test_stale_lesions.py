"""Lesions carry what they are of: stale ones are noticed, and moved or old ones are understood."""

import json
import re
import shlex
import shutil

import pytest

from bilateral_rl import __version__
from bilateral_rl.analysis.results import read_results

RUN = "runs/random_reach/cc_s-bptt-1"
LESIONS = f"{RUN}-lesions"
FLAGS = ("--no-retrain", "--lesion", "callosum", "--trials", 4)


def train_further(run, name="final"):
    """Change the weights, as more training does."""
    tensors = run.load_weights(name).items()
    run.save_weights(name, {key: 0.5 * value if value.is_floating_point() else value for key, value in tensors})


def as_of_0_1_0(folder, run):
    """Reduce ``settings.json`` to what version 0.1.0 wrote."""
    path = folder / "settings.json"
    settings = json.loads(path.read_text())
    for name in ("weights_hash", "version", "networks"):
        del settings[name]
    path.write_text(json.dumps(settings | {"run": str(run.resolve())}))


@pytest.fixture
def ok(call):
    def ok(*arguments):
        code, out, err = call(*arguments)
        assert (code, err) == (0, "")
        return " ".join(out.split())

    return ok


@pytest.fixture
def refused(call):
    def refused(*arguments):
        code, out, err = call(*arguments)
        assert (code, out) == (2, "")
        assert len(err.strip().splitlines()) == 1
        return err

    return refused


@pytest.fixture
def lesioned(ok, trained, undrawn, tmp_path):
    """A run with its lesions."""
    ok("lesion", RUN, *FLAGS)
    return trained


def test_settings_say_what_the_results_are_of(lesioned, tmp_path):
    settings = json.loads((tmp_path / LESIONS / "settings.json").read_text())
    assert settings["run"] == "../cc_s-bptt-1"
    assert settings["weights_hash"] == lesioned.weights_hash("final")
    assert settings["networks"] == [0, 1, 2]
    assert settings["version"] == __version__
    assert str(tmp_path) not in (tmp_path / LESIONS / "settings.json").read_text()


def test_lesions_of_weights_that_are_gone_are_refused_with_the_command_that_makes_them_anew(
    ok, refused, lesioned, tmp_path
):
    assert "weights" not in ok("compare", RUN)
    before = read_results(tmp_path / LESIONS / "lesions.csv")
    train_further(lesioned)
    err = refused("compare", RUN)
    assert "weights that" in err
    assert "no longer has" in err
    (command,) = re.findall("`bilateral-rl (.*)`", err)
    assert shlex.split(command)[1:] == [RUN, "--lesion", "callosum", "--no-retrain", "--trials", "4"]
    assert "take the place of lesions of weights that the run no longer has" in ok(*shlex.split(command))
    assert not read_results(tmp_path / LESIONS / "lesions.csv").equals(before)
    assert "weights" not in ok("compare", RUN)


def test_the_command_that_makes_lesions_anew_asks_for_the_same_protocols(ok, refused, trained, undrawn, tmp_path):
    names = ["everything", "output-3-epochs-lr-0.01", "none"]
    flags = ["--lesion", "callosum", "--trials", 4, *(word for name in names for word in ("--retrain", name))]
    ok("lesion", RUN, "--no-control", *flags)
    before = read_results(tmp_path / LESIONS / "lesions.csv")
    train_further(trained)
    (command,) = re.findall("`bilateral-rl (.*)`", refused("compare", RUN))
    ok(*shlex.split(command))
    after = read_results(tmp_path / LESIONS / "lesions.csv")
    assert list(dict.fromkeys(after["protocol"])) == names
    assert after.drop(columns="value").equals(before.drop(columns="value"))
    ok("compare", RUN, "--retrain", "output-3-epochs-lr-0.01")


def test_other_weights_of_the_run_may_change(ok, trained, undrawn):
    ok("lesion", RUN, *FLAGS, "--weights", "best")
    train_further(trained, "final")
    ok("compare", RUN)


def test_weights_that_were_removed_make_lesions_stale(refused, lesioned):
    (lesioned.path / "weights" / "final.safetensors").unlink()
    assert "no longer has" in refused("compare", RUN)


def test_lesions_of_version_0_1_0_are_compared_with_a_note_and_made_anew(ok, lesioned, tmp_path):
    as_of_0_1_0(tmp_path / LESIONS, lesioned.path)
    train_further(lesioned)
    out = ok("compare", RUN)
    assert "does not say which weights it is of" in out
    assert f"call `bilateral-rl lesion {RUN} --lesion callosum --no-retrain --trials 4`" in out
    ok("lesion", RUN, *FLAGS)
    assert "weights" not in ok("compare", RUN)


@pytest.mark.parametrize("old", [False, True])
@pytest.mark.parametrize("out", [(), ("--out", "runs/elsewhere")])
def test_runs_can_be_moved_with_their_lesions(ok, trained, undrawn, tmp_path, old, out):
    ok("lesion", RUN, *FLAGS, *out)
    if old:
        as_of_0_1_0(tmp_path / (out[1] if out else LESIONS), trained.path)
    (tmp_path / "runs").rename(tmp_path / "moved")
    moved = [str(text).replace("runs/", "moved/") for text in (RUN, *FLAGS, *out)]
    ok("lesion", *moved)
    if not out:
        ok("compare", moved[0])


def test_the_lesions_of_another_run_are_not_replaced(ok, refused, trained, undrawn, tmp_path):
    other = trained.path.with_name("cc_s-bptt-2")
    shutil.copytree(trained.path, other)
    ok("lesion", RUN, *FLAGS, "--out", "x")
    ok("lesion", str(other), *FLAGS, "--out", "x")  # of the same weights
    train_further(trained)
    assert "x holds the lesions of another run" in refused("lesion", RUN, *FLAGS, "--out", "x")
    assert "with other settings (networks: 0, 1, 2 there and 1 asked for)" in refused(
        "lesion", f"{other}:1", *FLAGS, "--out", "x"
    )
    as_of_0_1_0(tmp_path / "x", other)
    assert "x holds the lesions of another run" in refused("lesion", RUN, *FLAGS, "--out", "x")


def test_settings_that_are_no_description_are_no_reason_to_crash(call, lesioned, tmp_path):
    for settings in ("[]", "3", '"run"', '{"run": 3, "weights_hash": []}', '{"run": "\\u0000"}'):
        (tmp_path / LESIONS / "settings.json").write_text(settings)
        code, out, _ = call("compare", RUN)
        assert code == 0
        assert "does not say which weights it is of" in " ".join(out.split())
        assert call("lesion", RUN, *FLAGS)[0] in (0, 2)


def test_nothing_is_left_of_folders_that_a_refused_study_needed(refused, trained, undrawn, tmp_path):
    (tmp_path / "new").mkdir()
    weights = trained.path / "weights" / "best.safetensors"
    weights.write_bytes(b"damaged")
    refused("lesion", RUN, *FLAGS, "--weights", "best", "--out", "new/a/b")
    assert not list((tmp_path / "new").iterdir())


# The command that makes lesions anew


@pytest.mark.parametrize(
    "options",
    [
        [],
        ["--no-retrain"],
        ["--retrain", "none", "--retrain", "combination", "--no-control"],
        ["--retrain", "everything", "--retrain-epochs", "2", "--retrain-learning-rate", "0.01"],
        ["--retrain", "output", "--retrain-penalty", "activity", "--retrain-penalty-coefficient", "0.5"],
        ["--retrain", "output", "--retrain-optimizer", "continued", "--retrain-trials", "training"],
    ],
)
def test_lesions_are_made_anew_by_the_protocols_that_they_were_made_by(
    refused, ok, trained, undrawn, tmp_path, options
):
    path = tmp_path / LESIONS / "settings.json"
    ok("lesion", RUN, "--lesion", "callosum", *options, "--trials", 4)
    before, tensors = json.loads(path.read_text()), trained.load_weights("final")
    train_further(trained)
    (command,) = re.findall("`bilateral-rl (.*)`", refused("compare", RUN))
    assert ("--no-control" in command) == ("--no-control" in options)
    path.unlink()  # it would keep other protocols out
    trained.save_weights("final", tensors)  # an optimizer is continued with its own weights alone
    ok(*shlex.split(command))
    assert json.loads(path.read_text()) == before


def as_really_of_0_1_0(folder, run, retrain):
    """As version 0.1.0 left them: ``settings.json`` with a switch, and a table with a column of it."""
    as_of_0_1_0(folder, run)
    path = folder / "settings.json"
    settings = json.loads(path.read_text())
    del settings["protocols"], settings["control"]
    path.write_text(json.dumps(settings | {"retrain": retrain}))
    table = read_results(folder / "lesions.csv")
    table = table[table["network"] == "trained"].assign(retrained=lambda rows: rows["protocol"] == "output")
    columns = ["model", "task", "algo", "seed", "lesion", "retrained", "metric", "value"]
    table[columns].to_csv(folder / "lesions.csv", index=False)


@pytest.mark.parametrize(
    ("options", "retrain"), [(["--no-retrain"], False), (["--retrain", "none", "--retrain", "output"], True)]
)
def test_lesions_of_version_0_1_0_are_compared_and_made_anew_by_the_same_protocols(
    ok, refused, trained, undrawn, tmp_path, options, retrain
):
    flags = ["--lesion", "callosum", *options, "--trials", "4"]
    ok("lesion", RUN, *flags, "--no-control")
    as_really_of_0_1_0(tmp_path / LESIONS, trained.path, retrain)
    out = ok("compare", RUN)
    assert ("output layer retrained" in out) == retrain
    assert f"call `bilateral-rl lesion {RUN} {' '.join(flags)}`" in out
    assert "with other settings (protocols: " in refused("lesion", RUN, "--lesion", "callosum", "--trials", "4")
    ok("lesion", RUN, *flags)
    assert set(read_results(tmp_path / LESIONS / "lesions.csv")["network"]) == {"trained", "fresh"}


def test_protocols_that_nobody_can_read_are_left_out_of_the_command(refused, trained, lesioned, tmp_path):
    path = tmp_path / LESIONS / "settings.json"
    settings = json.loads(path.read_text())
    train_further(trained)
    for damaged in (3, [3], [{"retrain": "all"}], [{"retrain": "output", "epochs": "x"}], [{}] * 2):
        path.write_text(json.dumps(settings | {"protocols": damaged}))
        assert "`bilateral-rl lesion" in refused("compare", RUN)
