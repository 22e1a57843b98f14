"""Every tutorial is done as it is written: its commands and scripts, word for word and in order."""

import re
import shlex
import subprocess
from pathlib import Path
from types import SimpleNamespace

import matplotlib as mpl
import pytest
from processes import CopiedJob
from typer.testing import CliRunner

from bilateral_rl.commands.app import app
from bilateral_rl.study import process

FOLDER = Path(__file__).parents[1] / "docs" / "tutorials"
NOTEBOOKS = {"recordings"}
"""Tutorials whose blocks are the cells of one notebook."""


def blocks(name):
    text = (FOLDER / f"{name}.md").read_text(encoding="utf-8")
    return re.findall(r"```(sh|python)\n(.*?)```", text, re.DOTALL)


def do(block, names):
    kind, text = block
    if kind == "python":
        exec(text, names)
        return
    for line in text.replace("\\\n", " ").splitlines():
        program, *arguments = shlex.split(line, comments=True)
        assert program == "bilateral-rl"
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 0, (line, result.output, result.exception)


@pytest.fixture(scope="module")
def workshop(tmp_path_factory):
    """The folder in which a reader does all tutorials, with the network that the first one trains."""
    folder = tmp_path_factory.mktemp("workshop")
    mpl.use("Agg")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        do(blocks("train-and-lesion")[0], {})
    return folder


@pytest.fixture(autouse=True)
def copied_jobs(monkeypatch):
    """Jobs but the first begin as copies of a process that has imported everything, which takes longer than the job."""
    starts = iter([subprocess.Popen])
    named = {name: getattr(subprocess, name) for name in ("DEVNULL", "STDOUT")}

    def start(*arguments, **options):
        return next(starts, CopiedJob)(*arguments, **options)

    monkeypatch.setattr(process, "subprocess", SimpleNamespace(Popen=start, **named))


@pytest.mark.parametrize("name", sorted(path.stem for path in FOLDER.glob("*.md")))
def test_a_tutorial_can_be_done_as_it_is_written(name, workshop, monkeypatch):
    monkeypatch.chdir(workshop)
    names = {"__name__": "__main__"}
    for block in blocks(name)[name == "train-and-lesion" :]:
        do(block, names if name in NOTEBOOKS else {"__name__": "__main__"})
    for path in re.findall(r"`(runs/[\w./-]+)`", (FOLDER / f"{name}.md").read_text(encoding="utf-8")):
        assert (workshop / path).exists(), f"{name} says that there is a {path}"


def test_what_a_tutorial_makes_is_apart_from_what_its_reader_has_trained():
    """Else its run would be number 2, and all that follows would be about number 1, another network."""
    made = re.compile(r"^bilateral-rl (?:train|import) .*", re.MULTILINE)
    for path in FOLDER.glob("*.md"):
        fenced = re.findall(r"```\w+\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL)
        for line in made.findall("".join(fenced).replace("\\\n", " ")):
            assert " --out runs/" in line, (path.name, line)


def test_tutorials_begin_with_the_same_network():
    (kind, first), *_ = blocks("train-and-lesion")
    assert (kind, first.split()[:2]) == ("sh", ["bilateral-rl", "train"])
