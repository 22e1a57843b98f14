import errno
from contextlib import contextmanager

import pytest

from bilateral_rl.config.parse import parse_overrides
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.yaml_files import read_settings
from bilateral_rl.study import folder as module
from bilateral_rl.study.folder import STUDY_FILE, claimed_folder, new_folder
from bilateral_rl.study.plan import Study
from bilateral_rl.study.sweep import Sweep

OVERRIDES = parse_overrides(["epochs=3", "bptt.learning_rate=1e-2", "bptt.patience=2"])


def claim_folder(folder, study):
    with claimed_folder(folder, study):
        pass


def values(**changes):
    return Study(**({"seeds": 4, "overrides": OVERRIDES} | changes)).to_values()


def test_a_folder_says_which_study_it_holds_and_takes_it_again(tmp_path):
    folder = tmp_path / "deep" / "study"
    claim_folder(folder, values())
    assert read_settings(folder / STUDY_FILE) == values()
    written = (folder / STUDY_FILE).read_bytes()
    (folder / "results").mkdir()
    claim_folder(folder, values())
    assert (folder / STUDY_FILE).read_bytes() == written
    assert {path.name for path in folder.iterdir()} == {STUDY_FILE, "results"}


def test_another_study_is_refused(tmp_path):
    for changes, name in (
        ({"seeds": 5}, "seeds = 4, not 5"),
        ({"first_seed": 100}, "first_seed = 0, not 100"),
        ({"algo": "ppo"}, "algo = 'bptt', not 'ppo'"),
        ({"quick": True}, "quick = False, not True"),
        ({"overrides": {}}, "overrides = "),
        ({"overrides": parse_overrides(["epochs=3", "bptt.patience=2"])}, "overrides = "),
        ({"overrides": OVERRIDES | {"seed": 1}}, "overrides = "),
    ):
        claim_folder(tmp_path, values())
        with pytest.raises(UserError, match="go on with it as it was begun, or choose another --out") as error:
            claim_folder(tmp_path, values(**changes))
        assert f"holds a study with {name}" in str(error.value)
        claim_folder(tmp_path, values())


def test_a_study_that_does_not_say_its_first_seed_began_at_0(tmp_path):
    before = values()
    assert before.pop("first_seed") == 0
    claim_folder(tmp_path, before)
    claim_folder(tmp_path, values())
    with pytest.raises(UserError, match="holds a study with first_seed = 0, not 100"):
        claim_folder(tmp_path, values(first_seed=100))
    assert read_settings(tmp_path / STUDY_FILE) == before


def test_sweeps_and_reproductions_do_not_mix(tmp_path):
    sweep = Sweep("bptt", {"epochs": ["1", "2"]}).to_values()
    claim_folder(tmp_path / "a", sweep)
    with pytest.raises(UserError, match="choose another --out"):
        claim_folder(tmp_path / "a", values())
    with pytest.raises(UserError, match="choose another --out"):
        claim_folder(tmp_path / "a", Sweep("bptt", {"epochs": ["1"]}).to_values())
    claim_folder(tmp_path / "b", values())
    with pytest.raises(UserError, match="choose another --out"):
        claim_folder(tmp_path / "b", sweep)


def test_a_folder_of_other_things_is_refused_and_stays_as_it_was(tmp_path):
    (tmp_path / "thesis.txt").write_text("")
    with pytest.raises(UserError, match="is not empty and holds no study"):
        claim_folder(tmp_path, values())
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_a_damaged_study_is_refused(tmp_path):
    (tmp_path / STUDY_FILE).write_text("[")
    with pytest.raises(UserError, match=STUDY_FILE):
        claim_folder(tmp_path, values())


def test_a_folder_that_cannot_be_written_is_refused(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="Choose another --out"):
        claim_folder(tmp_path / "file" / "study", values())

    @contextmanager
    def full(path):
        raise OSError(errno.ENOSPC, "No space left on device")
        yield

    monkeypatch.setattr(module, "replacing", full)
    with pytest.raises(UserError, match=r"No space left on device\. Choose another --out"):
        claim_folder(tmp_path / "study", values())


def test_no_trace_is_left_of_a_study_that_is_refused_before_anything_is_done(tmp_path):
    folder = tmp_path / "a" / "b" / "study"
    with pytest.raises(UserError, match="no cluster"), claimed_folder(folder, values()):
        raise UserError("There is no cluster.")
    assert not list(tmp_path.iterdir())


def test_a_study_of_before_models_could_be_chosen_is_of_all(tmp_path):
    values_then = {name: value for name, value in Study().to_values().items() if name not in ("models", "first_seed")}
    with claimed_folder(tmp_path / "study", values_then):
        (tmp_path / "study" / "logs").mkdir()
    with claimed_folder(tmp_path / "study", Study().to_values()):
        pass
    with (
        pytest.raises(UserError, match="holds a study with models"),
        claimed_folder(tmp_path / "study", Study(models=("cc_s",)).to_values()),
    ):
        pass


def test_runs_that_were_made_elsewhere_can_lie_in_the_folder_of_a_new_study(tmp_path):
    folder = tmp_path / "study"
    (folder / "runs" / "seed-0").mkdir(parents=True)
    with pytest.raises(UserError, match="no cluster"), claimed_folder(folder, values()):
        raise UserError("There is no cluster.")
    assert [path.name for path in folder.iterdir()] == ["runs"]
    with claimed_folder(folder, values()):
        assert (folder / STUDY_FILE).is_file()
    assert (folder / "runs" / "seed-0").is_dir()


def test_a_study_that_was_begun_stays_when_it_is_refused(tmp_path):
    logs = tmp_path / "study" / "logs"
    with pytest.raises(FileExistsError), claimed_folder(tmp_path / "study", values()):
        logs.mkdir() or logs.mkdir()
    with pytest.raises(UserError, match="no cluster"), claimed_folder(tmp_path / "study", values()):
        raise UserError("There is no cluster.")
    assert {path.name for path in (tmp_path / "study").iterdir()} == {STUDY_FILE, "logs"}


def test_folders_vanish_with_what_fails_if_they_are_empty(tmp_path):
    file = tmp_path / "there" / "new" / "file"
    file.parents[1].mkdir()
    with pytest.raises(NotADirectoryError), new_folder(file.parent / "deep"):
        file.touch() or (file / "below").touch()
    assert list(file.parent.iterdir()) == [file]


def test_a_study_goes_on_with_other_settings_of_the_machine(tmp_path):
    begun, on_another = {"overrides": {"epochs": 2, "device": "cuda"}}, {"overrides": {"epochs": 2, "threads": 3}}
    with claimed_folder(tmp_path / "study", begun):
        pass
    with claimed_folder(tmp_path / "study", on_another):
        pass
    with (
        pytest.raises(UserError, match="holds a study with overrides"),
        claimed_folder(tmp_path / "study", {"overrides": {"epochs": 3, "device": "cuda"}}),
    ):
        pass


def test_a_folder_takes_one_command_at_a_time(tmp_path):
    folder, study = tmp_path / "study", Study().to_values()
    with claimed_folder(folder, study):
        with pytest.raises(UserError, match="Another command is at work in the study"), claimed_folder(folder, study):
            pass
        assert (folder / STUDY_FILE).is_file()
    with claimed_folder(folder, study):
        pass
    assert [path.name for path in folder.iterdir()] == [STUDY_FILE]
