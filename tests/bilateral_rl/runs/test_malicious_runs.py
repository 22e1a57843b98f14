"""Somebody else's run, made to do harm: refused in one sentence, with nothing changed and nothing executed."""

import contextlib
import dataclasses
import hashlib
import os
import shutil
import signal
import stat
import subprocess
import tempfile
from pathlib import Path

import hostile_files as hostile
import matplotlib
import pytest
import yaml

from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.commands import app as cli
from bilateral_rl.figures.style import forget_working_folder
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.tensors import save
from bilateral_rl.io.terminal import Terminal
from bilateral_rl.io.yaml_files import read_settings
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import load_policies, network_states
from bilateral_rl.study.folder import claimed_folder
from bilateral_rl.study.outcome import learning_history, read_result
from bilateral_rl.training import run as training

SECONDS = 30
"""More than any refusal takes on a busy machine; a pipe would be waited for forever."""
MOST_MEMORY = 400
"""By which the process may grow (MiB); of the traps most would take 10 GB."""


class TooLate(BaseException):
    """Nothing catches it."""


@pytest.fixture(autouse=True)
def in_time():
    def too_late(*_):
        raise TooLate

    before = signal.signal(signal.SIGALRM, too_late)
    signal.alarm(SECONDS)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture
def canary(tmp_path):
    """A file that is there if anything was executed."""
    return tmp_path / "canary"


@pytest.fixture
def outside(tmp_path):
    """A file that is no part of any run."""
    path = tmp_path / "home" / ".bashrc"
    path.parent.mkdir()
    path.write_text("mine\n")
    return path


@pytest.fixture
def run(run):
    """A run, and a sound one beside it."""
    shutil.copytree(run.path, run.path.with_name("sound"))
    return run


@pytest.fixture
def bptt_run(bptt_run):
    """A supervised run, and a sound one beside it."""
    shutil.copytree(bptt_run.path, bptt_run.path.with_name("sound"))
    return bptt_run


@pytest.fixture
def unharmed(tmp_path, monkeypatch, canary):
    """A context that must change no file, execute nothing and take no memory to speak of."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))

    @contextlib.contextmanager
    def check():
        before, memory = listing(tmp_path), peak_memory(reset=True)
        yield
        assert listing(tmp_path) == before
        assert peak_memory() - memory < MOST_MEMORY * 2**20
        assert not canary.exists()

    return check


@pytest.fixture
def not_read(unharmed):
    """Calls a function that must refuse what it should read."""

    def check(function, says=""):
        with unharmed(), pytest.raises(UserError) as error:
            function()
        assert says in str(error.value)
        assert len(str(error.value).splitlines()) == 1
        assert len(str(error.value)) < 5_000
        assert str(error.value).isprintable()

    return check


@pytest.fixture
def refused(call, unharmed, monkeypatch):
    """Calls commands that must each refuse: exit code 2, and one line that holds ``says``."""
    monkeypatch.setattr(cli, "console", Terminal(width=80))

    def check(*commands, says=""):
        for arguments in commands:
            with unharmed():
                code, out, err = call(*arguments)
            assert code == 2, (arguments, out, err)
            assert err.startswith("Error: "), err
            assert err.count("\n") == 1
            assert says in err
            assert "\x1b" not in out + err

    return check


def listing(path):
    """Everything below a folder: kind; size, time and contents of files."""
    found = {}
    for place in sorted(path.rglob("*")):
        status = place.lstat()
        small = stat.S_ISREG(status.st_mode) and status.st_size < 2**22
        content = hashlib.sha256(place.read_bytes()).hexdigest() if small else None
        of_file = None if place.is_dir() else (status.st_size, status.st_mtime_ns, content)
        found[str(place)] = (status.st_mode, of_file)
    return found


def peak_memory(reset=False):
    """Of this process (bytes), since it was last reset."""
    if reset:
        Path("/proc/self/clear_refs").write_text("5")
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return 1024 * int(line.split()[1])


def readers(run):
    """Commands that read a run's configuration and weights."""
    yield "evaluate", run, "--trials", 4
    yield "lesion", run, "--trials", 4, "--no-retrain"
    yield "compare", run, run.with_name("sound"), "--trials", 4
    yield "render", run, "--trials", 1
    yield "train", "--init-from", run, "--timesteps", 100


def resuming(run):
    yield "train", "--resume", run, "--timesteps", 100_000


def put(path, content):
    """In the place of what is there: bytes, or what makes something else of it."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
    if callable(content):
        content(path)
    else:
        path.write_bytes(content)


# What every command does with a trap


@pytest.mark.parametrize("trap", ["pickle", "an alias bomb", "a pipe", "a link out"])
def test_no_command_takes_a_configuration_that_is_a_trap(run, refused, canary, outside, trap):
    shutil.copyfile(run.path / "config.yaml", outside)
    put(run.path / "config.yaml", content_of(trap, canary, outside))
    refused(*readers(run.path), *resuming(run.path), says="config.yaml")


@pytest.mark.parametrize("trap", ["pickle", "a header of 10 GB", "a pipe", "a link out"])
def test_no_command_takes_weights_that_are_a_trap(run, refused, canary, outside, trap):
    shutil.copyfile(run.path / "weights/final.safetensors", outside)
    put(run.path / "weights/final.safetensors", content_of(trap, canary, outside))
    refused(*readers(run.path), says="final.safetensors")


@pytest.mark.slow
@pytest.mark.parametrize("trap", [*hostile.YAMLS, *hostile.PICKLES, *hostile.PLACES])
def test_no_command_takes_any_configuration_that_is_a_trap(run, refused, canary, outside, trap):
    shutil.copyfile(run.path / "config.yaml", outside)
    put(run.path / "config.yaml", content_of(trap, canary, outside))
    refused(*readers(run.path), *resuming(run.path))


@pytest.mark.slow
@pytest.mark.parametrize("trap", [*hostile.HEADERS, *hostile.CHANGES, *hostile.PICKLES, *hostile.PLACES])
@pytest.mark.parametrize("of", ["run", "bptt_run"])
def test_no_command_takes_any_weights_that_are_a_trap(request, refused, canary, outside, of, trap):
    run = request.getfixturevalue(of)
    path = run.path / "weights/final.safetensors"
    shutil.copyfile(path, outside)
    put(
        path,
        hostile.changed(path, hostile.CHANGES[trap]) if trap in hostile.CHANGES else content_of(trap, canary, outside),
    )
    refused(*readers(run.path))


def content_of(trap, canary, outside):
    """As :func:`put` takes it."""
    if trap in hostile.PLACES:
        return lambda path: hostile.PLACES[trap](path, outside)
    if trap in hostile.PICKLES:
        return hostile.PICKLES[trap](canary)
    return {**hostile.YAMLS, **hostile.HEADERS}[trap].replace(b"{canary}", str(canary).encode())


# Configurations


@pytest.mark.parametrize("trap", [*hostile.YAMLS, *hostile.PICKLES, *hostile.PLACES])
def test_a_configuration_that_is_a_trap(run, not_read, canary, outside, trap):
    shutil.copyfile(run.path / "config.yaml", outside)
    put(run.path / "config.yaml", content_of(trap, canary, outside))
    not_read(lambda: RunFolder.open(run.path).config(), says="config.yaml")


def test_a_configuration_that_is_given_may_be_a_pipe_but_no_trap(run, refused, call, tmp_path):
    endless = tmp_path / "zero"
    endless.symlink_to("/dev/zero")
    refused(("train", "--config", endless), says="larger")
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    text = (run.path / "config.yaml").read_text()
    with subprocess.Popen(["sh", "-c", f"cat {run.path / 'config.yaml'} > {pipe}"]):
        assert yaml.safe_dump(read_settings(pipe), sort_keys=False) == text


# Weights


@pytest.mark.parametrize("suffix", [".pth", ".zip", ".npz", ".pkl", ".pt"])
def test_pickles_beside_weights_are_not_even_seen(run, not_read, canary, suffix):
    (run.path / "weights/final.safetensors").unlink()
    for kind in hostile.PICKLES.values():
        put(run.path / f"weights/final{suffix}", kind(canary))
        not_read(lambda: load_policies(run), says="the run's weights are: best")


@pytest.mark.parametrize("trap", [*hostile.HEADERS, *hostile.PICKLES, *hostile.PLACES])
@pytest.mark.parametrize("of", ["run", "bptt_run"])
def test_weights_that_are_a_trap(request, not_read, canary, outside, of, trap):
    run = request.getfixturevalue(of)
    shutil.copyfile(run.path / "weights/final.safetensors", outside)
    put(run.path / "weights/final.safetensors", content_of(trap, canary, outside))
    not_read(lambda: load_policies(run), says=str(run.path))


@pytest.mark.parametrize("change", hostile.CHANGES)
@pytest.mark.parametrize("of", ["run", "bptt_run"])
def test_weights_that_do_not_fit(request, not_read, of, change):
    run = request.getfixturevalue(of)
    path = run.path / "weights/final.safetensors"
    put(path, hostile.changed(path, hostile.CHANGES[change]))
    not_read(lambda: load_policies(run), says=str(run.path))
    not_read(lambda: network_states(run), says=str(run.path))


def test_weights_that_are_cut_anywhere(run, not_read):
    path = run.path / "weights/final.safetensors"
    whole = path.read_bytes()
    for end in [*range(17), *range(17, len(whole), len(whole) // 100), len(whole) - 1]:
        path.write_bytes(whole[:end])
        with pytest.raises(UserError, match="damaged"):
            run.load_weights("final")


@pytest.mark.parametrize("place", hostile.PLACES)
def test_a_folder_of_weights_that_is_none(run, not_read, outside, place):
    outside.unlink()
    shutil.copytree(run.path / "weights", outside)
    put(run.path / "weights", lambda path: hostile.PLACES[place](path, outside))
    not_read(lambda: load_policies(run), says="weights")


@pytest.mark.parametrize(
    "name", ["../../x", "/etc/passwd", "../final", "final/../../x", "", ".", "..", "a\nb", "\0", "\x1b[31m[red]"]
)
def test_weights_elsewhere(run, not_read, name):
    sound = run.load_weights("final")
    for place in (run.path.parent / "x.safetensors", run.path / "final.safetensors", run.path / "weights/.safetensors"):
        save(sound, place)
    not_read(lambda: load_policies(run, name), says="the run's weights are:")


def test_no_command_takes_weights_elsewhere(run, refused):
    save(run.load_weights("final"), run.path.parent / "x.safetensors")
    commands = [(command, run.path, "--weights", "../../x") for command in ("evaluate", "lesion", "render")]
    refused(*commands, says="the run's weights are: best, final")


def test_weights_that_overflow(run, refused):
    """Finite numbers of which the network makes others."""
    path = run.path / "weights/final.safetensors"

    def change(tensors):
        for name, tensor in tensors.items():
            if "combination" in name or "output" in name:
                tensor.fill_(3e38)
                tensor.view(-1)[::2] *= -1

    put(path, hostile.changed(path, change))
    refused(*list(readers(run.path))[:4], says="cannot be tested")


def test_an_exploration_that_overflows(run, refused):
    path = run.path / "weights/final.safetensors"
    put(path, hostile.changed(path, lambda tensors: tensors["log_std"].fill_(-3e38)))
    refused(("evaluate", run.path, "--trials", 2, "--no-deterministic"), says="cannot be tested")


# What the training wrote beside them


@pytest.mark.parametrize("trap", [*hostile.JSONS, *hostile.PICKLES, *hostile.PLACES])
def test_a_status_that_is_a_trap(run, not_read, canary, outside, trap):
    if trap == "a link to nothing":
        pytest.skip("a run without one has never been saved")
    shutil.copyfile(run.path / "status.json", outside)
    content = hostile.JSONS[trap] if trap in hostile.JSONS else content_of(trap, canary, outside)
    put(run.path / "status.json", content)
    not_read(run.status, says="status.json")


@pytest.mark.parametrize("of", ["run", "bptt_run"])
def test_a_training_that_is_a_pickle(request, refused, canary, of):
    run = request.getfixturevalue(of)
    for name in ("resume.safetensors", "status.json"):
        put(run.path / name, hostile.pickled(canary))
        refused(("train", "--resume", run.path, *longer(of)), says=f"{name} is damaged")


@pytest.mark.parametrize("trap", [*hostile.HEADERS, *hostile.PICKLES, *hostile.PLACES])
def test_a_state_that_is_a_trap(run, not_read, canary, outside, trap):
    put(run.path / "resume.safetensors", content_of(trap, canary, outside))
    not_read(lambda: training.resume(run, longer_config(run)), says=str(run.path / "resume.safetensors"))


@pytest.mark.parametrize("change", hostile.CHANGES)
@pytest.mark.parametrize("of", ["run", "bptt_run"])
def test_a_state_that_does_not_fit(request, not_read, of, change):
    run = request.getfixturevalue(of)
    path = run.path / "resume.safetensors"
    put(path, hostile.changed(path, hostile.CHANGES[change]))
    not_read(lambda: training.resume(run, longer_config(run)), says="resume.safetensors is damaged")


def longer(of):
    return ("--timesteps", 100_000) if of == "run" else ("--epochs", 100)


def longer_config(run):
    config = run.config()
    values = {"epochs": 100} if config.algo == "bptt" else {"timesteps": 100_000}
    return dataclasses.replace(config, **values)


@pytest.mark.parametrize(
    "name",
    [
        "status.json", "config.yaml", "resume.safetensors", "evaluations.csv", "monitor.csv", "weights",
        "weights/final.safetensors", ".lock", "anything",
    ],
)  # fmt: skip
@pytest.mark.parametrize("place", ["a link out", "a pipe", "a device", "a link to nothing"])
def test_a_training_is_not_continued_through_a_link_or_into_a_pipe(run, not_read, outside, name, place):
    config = longer_config(run)
    put(run.path / name, lambda path: hostile.PLACES[place](path, outside))
    not_read(lambda: training.resume(run, config), says=name)
    assert outside.read_text() == "mine\n"


@pytest.mark.parametrize("name", ["epochs.csv", "seed_0", "weights"])
def test_a_supervised_training_is_not_continued_through_a_link(bptt_run, refused, outside, name):
    put(bptt_run.path / name, lambda path: path.symlink_to(outside.parent if name != "epochs.csv" else outside))
    refused(("train", "--resume", bptt_run.path, "--epochs", 100), says="is a link out of")


# Links that do no harm


def test_a_run_that_is_linked_to_or_links_within_itself_is_read(call, run, tmp_path):
    final = run.path / "weights/final.safetensors"
    final.rename(run.path / "weights/best.safetensors")
    final.symlink_to("best.safetensors")
    (tmp_path / "link").symlink_to(run.path)
    os.link(run.path / "config.yaml", tmp_path / "hard")
    code, out, err = call("evaluate", tmp_path / "link", "--trials", 2)
    assert (code, err) == (0, "")
    assert "goal radius" in out


# What lies beside a run


def test_lesions_are_not_written_through_a_link(run, refused, tmp_path):
    target = tmp_path / "empty"
    target.mkdir()
    place = run.path.with_name(f"{run.path.name}-lesions")
    place.symlink_to(target)
    refused(("lesion", run.path, "--trials", 4, "--no-retrain"), says="is a link")


@pytest.mark.parametrize("name", ["lesions.csv", "lesions_final_error.png", "anything"])
def test_lesions_are_not_written_among_links(run, refused, outside, name):
    place = run.path.with_name(f"{run.path.name}-lesions")
    place.mkdir()
    (place / "lesions.csv").touch()
    put(place / name, lambda path: path.symlink_to(outside))
    refused(("lesion", run.path, "--trials", 4, "--no-retrain"), says="is a link out of")


def test_a_video_is_not_written_through_a_link(run, refused, outside):
    run.path.with_name(f"{run.path.name}.mp4").symlink_to(outside.with_name("autostart"))
    refused(("render", run.path, "--trials", 1), says="choose another --out")


def table(*rows):
    return "\n".join([",".join(COLUMNS), *rows]).encode()


TABLES = {
    "no words": b"\xff\xfe\x00",
    "nothing": b"",
    "columns without end": b"a," * 10_000_000,
    "a longer row": table("1," * 100_000),
    "rows that are all longer": table("x,cc_s,random_reach,ppo,0,intact,False,effort,1"),
    "a quote without end": table('"' + "x" * 1_000_000),
    "an unknown lesion": table("cc_s,random_reach,ppo,0,\x1b[31m[red],False,effort,1"),
    "an unknown model": table("$\\input{/etc/passwd}$,random_reach,ppo,0,intact,False,effort,1"),
    "a number too large": table("cc_s,random_reach,ppo,0,intact,False,effort,1e300"),
    "a seed too large": table("cc_s,random_reach,ppo,1e300,intact,False,effort,1"),
    "many seeds": table(*(f"cc_s,random_reach,ppo,{i},intact,False,effort,1" for i in range(100_000))),
    "a value twice": table(*2 * ["cc_s,random_reach,ppo,0,intact,False,effort,1"]),
}


@pytest.mark.parametrize("trap", ["nothing", "an unknown lesion"])
def test_lesions_that_are_a_trap(run, refused, trap):
    place = run.path.with_name(f"{run.path.name}-lesions")
    place.mkdir()
    (place / "lesions.csv").write_bytes(TABLES[trap])
    refused(("compare", run.path), says="lesions.csv")


@pytest.mark.parametrize("trap", ["deep lists", "a number", "pickle", "a pipe"])
def test_settings_of_lesions_that_are_a_trap(run, refused, canary, outside, trap):
    place = run.path.with_name(f"{run.path.name}-lesions")
    place.mkdir()
    (place / "lesions.csv").touch()
    content = hostile.JSONS[trap] if trap in hostile.JSONS else content_of(trap, canary, outside)
    put(place / "settings.json", content)
    refused(("lesion", run.path, "--trials", 4, "--no-retrain"))


# Lists of runs


@pytest.mark.parametrize("name", ["config.yaml", "status.json"])
@pytest.mark.parametrize("trap", ["pickle", "a pipe", "a link out", "a link to itself", "a link to nothing"])
def test_a_list_shows_a_trap_among_runs_as_unreadable(call, run, outside, canary, trap, name):
    bad = run.path.with_name("cc_s-ppo-2")
    shutil.copytree(run.path, bad)
    place = hostile.PLACES.get(trap)
    put(bad / name, hostile.pickled(canary) if place is None else lambda path: place(path, outside))
    code, out, err = call("list")
    assert (code, err) == (0, "")
    (good,) = (line for line in out.splitlines() if "cc_s-ppo-1" in line)
    assert "finished" in good
    shown = [line for line in out.splitlines() if "cc_s-ppo-2" in line]
    if "link to" in trap and name == "config.yaml":
        assert not shown  # a folder without one is no run
    else:
        (line,) = shown
        assert ("?" if trap == "a link to nothing" else "unreadable") in line
    assert not canary.exists()


@pytest.mark.parametrize(
    "name", ["\x1b[31m[red]evil\x1b]0;title\x07", "[bold]x", "line\nbreak", "\u202eright", "\udce4"]
)
def test_a_name_does_not_steer_the_terminal(call, run, monkeypatch, name):
    monkeypatch.setattr(cli, "console", Terminal(width=300))
    bad = run.path.with_name(name)
    run.path.rename(bad)
    for arguments in (["list"], ["evaluate", bad, "--trials", 2], ["evaluate", bad / "x"]):
        _, out, err = call(*arguments)
        assert not {"\x1b", "\x07", "\u202e", "\udce4"} & {*(out + err)}
    if "bold" in name:
        assert name in out + err


# Studies


@pytest.fixture
def study(call, tmp_path):
    """A sweep that is done, without a training: its one point's results were there before."""
    folder = tmp_path / "sweep"
    (folder / "results").mkdir(parents=True)
    values = {"sweep": {"seed": ["0"]}, "algo": "bptt", "overrides": {}, "trials": 4}
    (folder / "study.yaml").write_text(yaml.safe_dump(values))
    rows = [f"cc_s,random_reach,bptt,0,intact,False,{name},1.0" for name in ("goal_completion_5cm", "final_error")]
    (folder / "results/seed=0.csv").write_bytes(table(*rows))
    return folder


def sweep(folder):
    return "sweep", "--grid", "seed=0", "--trials", 4, "--out", folder


def test_a_study_that_is_done_is_read(call, study):
    code, out, err = call(*sweep(study))
    assert (code, err) == (0, "")
    assert "1 of 1 jobs were done before" in out


def claim(folder):
    """As a sweep begins."""
    with claimed_folder(folder, {"sweep": {"seed": ["0"]}, "algo": "bptt", "overrides": {}, "trials": 4}):
        pass


@pytest.mark.parametrize("trap", [*hostile.YAMLS, *hostile.PICKLES])
def test_a_study_that_is_a_trap(study, not_read, canary, outside, trap):
    put(study / "study.yaml", content_of(trap, canary, outside))
    not_read(lambda: claim(study))


def test_no_command_goes_on_with_a_study_that_is_a_trap(study, refused, canary):
    put(study / "study.yaml", hostile.pickled(canary))
    refused(sweep(study), ("reproduce", "--quick", "--out", study), says="study.yaml is neither YAML nor JSON")


@pytest.mark.parametrize("name", ["study.yaml", "sweep.csv", "results", "results/seed=0.csv", "logs", "runs"])
@pytest.mark.parametrize("place", ["a link out", "a pipe", "a device"])
def test_a_study_is_not_continued_through_a_link_or_into_a_pipe(study, not_read, outside, name, place):
    put(study / name, lambda path: hostile.PLACES[place](path, outside))
    not_read(lambda: claim(study), says=name)


def test_no_command_goes_on_with_a_study_that_leads_elsewhere(study, refused, outside):
    (study / "logs").symlink_to(outside.parent)
    refused(sweep(study), ("reproduce", "--quick", "--out", study), says="is a link out of")


@pytest.mark.parametrize("trap", TABLES)
def test_results_that_are_a_trap(study, not_read, trap):
    put(study / "results/seed=0.csv", TABLES[trap])
    not_read(lambda: read_result(study / "results/seed=0.csv"), says="seed=0.csv")


def test_no_sweep_takes_results_that_are_a_trap(study, refused, canary):
    put(study / "results/seed=0.csv", hostile.pickled(canary))
    refused(sweep(study), says="seed=0.csv")


@pytest.mark.parametrize("trap", [*hostile.PICKLES, *hostile.PLACES])
@pytest.mark.parametrize("of", ["run", "bptt_run"])
def test_learning_curves_that_are_a_trap(request, not_read, canary, outside, of, trap):
    run = request.getfixturevalue(of)
    put(run.path / ("evaluations.csv" if of == "run" else "epochs.csv"), content_of(trap, canary, outside))
    not_read(lambda: learning_history({"cc_s": [run]}), says=".csv")


@pytest.mark.parametrize(
    "rows",
    ["9,1,1.5,1.5,1.5", "\n".join(f"0,{i},1.5,1.5,1.5" for i in range(200_000))],
    ids=["another seed", "too long"],
)
def test_learning_curves_without_end_are_not_drawn(bptt_run, not_read, rows):
    head = "seed,epoch,validation_loss,goal_completion_percent,time_in_goal_steps\n"
    put(bptt_run.path / "epochs.csv", (head + rows).encode())
    not_read(lambda: learning_history({"cc_s": [bptt_run]}), says="epochs.csv is damaged")


# The working folder


def test_figures_do_not_follow_the_settings_of_the_working_folder(tmp_path, monkeypatch):
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\n")
    monkeypatch.chdir(tmp_path)
    with matplotlib.rc_context(fname="matplotlibrc"):
        assert matplotlib.rcParams["text.usetex"]
        forget_working_folder()
        assert not matplotlib.rcParams["text.usetex"]


def test_figures_follow_the_settings_of_their_user(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with matplotlib.rc_context({"lines.linewidth": 7}):
        forget_working_folder()
        assert matplotlib.rcParams["lines.linewidth"] == 7
