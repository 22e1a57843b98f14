from pathlib import Path

import pytest

from bilateral_rl.study.board import Board
from bilateral_rl.study.jobs import Job

HERE = Path(__file__).parent


@pytest.fixture(autouse=True)
def toy_jobs_can_be_imported(monkeypatch):
    """Here, and so in the processes of jobs."""
    monkeypatch.syspath_prepend(str(HERE))


class Watcher(Board):
    """Keeps what it is told, in order; ``react`` is called with each."""

    def __init__(self, react=lambda what, name: None):
        self.told, self.done_before = [], None
        self._react = react

    def begin(self, jobs, done):
        self.done_before = set(done)

    def on_start(self, job):
        self._tell("start", job.name)

    def on_progress(self, job, done, text):
        self._tell("progress", job.name, done, text)

    def on_end(self, outcome):
        self._tell(str(outcome.state), outcome.job.name)

    def tick(self):
        self._react("tick", None)

    def _tell(self, what, name, *values):
        self.told.append((what, name, *values))
        self._react(what, name)


@pytest.fixture
def make_watcher():
    return Watcher


@pytest.fixture
def watcher():
    return Watcher()


def _toy(function, name, cost=1.0, threads=1, **arguments):
    """A job of ``toy_jobs``; the function is told its name if it takes arguments at all."""
    named = function not in ("fail", "leave", "kill_itself", "forget", "ignore_interrupts")
    return Job(name, f"toy_jobs:{function}", name, {"name": name} | arguments if named else {}, cost, threads)


@pytest.fixture(scope="session")
def toy():
    return _toy


def _events(folder):
    lines = (folder / "events.txt").read_text().splitlines() if (folder / "events.txt").exists() else []
    return [(name, what, int(process)) for name, what, process in map(str.split, lines)]


@pytest.fixture(scope="session")
def events():
    """What toy jobs noted below a folder: name, what, process."""
    return _events


def _is_alive(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.fixture(scope="session")
def is_alive():
    """Whether a process runs, by its id."""
    return _is_alive
