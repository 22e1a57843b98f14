"""The jobs of a study on a Ray cluster, whose nodes need share no files, and may be lost."""

from __future__ import annotations

import contextlib
import importlib
import os
import socket
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from bilateral_rl.io.errors import UserError
from bilateral_rl.study.board import SILENT, Board
from bilateral_rl.study.jobs import Job, JobOutcome, JobState, begin
from bilateral_rl.study.process import JobProcess
from bilateral_rl.study.transfer import pack, unpack
from bilateral_rl.training.progress import StopRequest

_RETRIES = 3
"""Number of times that a job starts once more after its node was lost."""
_INTERVAL = 0.2
"""Seconds between two looks."""
_PATIENCE = 10
"""Seconds in which canceled jobs should end, and a cluster answer."""


def run_on_ray(jobs: Sequence[Job], folder: Path, address: str, board: Board = SILENT) -> list[JobOutcome]:
    """Do every job that is not done, wherever the cluster has as many free CPUs as the job has threads.

    A job works in an empty folder on its node, so it begins anew even where it was interrupted here before; what it
    wrote comes back when it is done, whole or not at all. If its node is lost, it begins again on another; if it fails
    by itself, it is not tried again. Ctrl-C cancels: what is not done is lost.

    Args:
        jobs: of the study. No two may write one file, those numbered by what else is in a folder included.
        folder: the study's, on this machine.
        address: of a cluster; "local" makes one of this machine for as long as the study takes.
        board: told how they come along.

    Returns:
        How each ended, in the order of ``jobs``.

    Raises:
        UserError: no Ray, no such cluster, a job with more threads than any node has CPUs, or a folder that cannot be
            written.
    """
    ray = _import_ray()
    outcomes, to_do = begin(jobs, folder)
    board.begin(jobs, set(outcomes))
    if to_do:
        with _connected(ray, address):
            _refuse_too_wide(ray, to_do)
            outcomes |= _Tasks(ray, folder, board).run(to_do)
    return [outcomes[job.name] for job in jobs]


@dataclass(frozen=True)
class _Returned:
    """What comes back from a node: the outcome, the log, and the files of a job that is done, by relative name."""

    outcome: JobOutcome
    log: bytes
    files: dict[str, bytes]


class _Mailbox:
    """An actor beside the driver, to which jobs tell their progress: (name, None) at the start, then reports."""

    def __init__(self) -> None:
        self._messages: list[tuple[str, Any]] = []

    def put(self, name: str, report: Any) -> None:
        self._messages.append((name, report))

    def take(self) -> list[tuple[str, Any]]:
        messages, self._messages = self._messages, []
        return messages


def _work(job: Job, mailbox: Any) -> _Returned:
    """Do a job on a node, in a process of its own as on one machine: its death is a failed job and not a lost node."""
    mailbox.put.remote(job.name, None)
    with tempfile.TemporaryDirectory(prefix="bilateral-rl-") as temporary:
        folder, log = Path(temporary, "study"), Path(temporary, "log")
        folder.mkdir()
        process = JobProcess(job, folder, log)
        try:
            while not process.ended:
                time.sleep(_INTERVAL)
                for report in process.reports()[-1:]:
                    mailbox.put.remote(job.name, report)
            outcome = replace(process.outcome(), log=None)
        finally:
            process.kill()  # canceled
        return _Returned(outcome, log.read_bytes(), pack(folder) if outcome.state == JobState.DONE else {})


@dataclass
class _Tasks:
    ray: Any
    folder: Path
    board: Board
    jobs: dict[Any, Job] = field(default_factory=dict)
    """Jobs under way, by the reference to what they will return."""
    writers: dict[str, str] = field(default_factory=dict)
    """Names of the jobs that wrote the files, by relative name."""

    def run(self, jobs: Sequence[Job]) -> dict[str, JobOutcome]:
        """Run every job, and return their outcomes by name."""
        mailbox = self._open_mailbox()
        self.jobs = {self._send(job, mailbox): job for job in jobs}
        outcomes = {}
        stop = StopRequest()
        try:
            with stop.on_interrupt():
                while self.jobs and not stop.requested:
                    ready, _ = self.ray.wait(list(self.jobs), timeout=_INTERVAL)
                    self._tell(mailbox)
                    for reference in ready:
                        outcome = self._receive(reference, self.jobs.pop(reference))
                        outcomes[outcome.job.name] = outcome
                        self.board.on_end(outcome)
        except KeyboardInterrupt:
            pass  # the second
        return outcomes | {outcome.job.name: outcome for outcome in self._cancel()}

    def _open_mailbox(self) -> Any:
        """Start the mailbox on the driver's node: with that one lost, all is lost anyway."""
        strategy = importlib.import_module("ray.util.scheduling_strategies").NodeAffinitySchedulingStrategy
        here = strategy(self.ray.get_runtime_context().get_node_id(), soft=False)
        return self.ray.remote(_Mailbox).options(num_cpus=0, scheduling_strategy=here).remote()

    def _send(self, job: Job, mailbox: Any) -> Any:
        return self.ray.remote(_work).options(num_cpus=job.threads, max_retries=_RETRIES).remote(job, mailbox)

    def _tell(self, mailbox: Any) -> None:
        under_way = {job.name: job for job in self.jobs.values()}
        messages = []
        with contextlib.suppress(self.ray.exceptions.RayError):  # it can be lost, which is no reason to stop
            messages = self.ray.get(mailbox.take.remote())
        for name, report in messages:
            if name in under_way:
                if report is None:
                    self.board.on_start(under_way[name])
                else:
                    self.board.on_progress(under_way[name], *report)
        self.board.tick()

    def _receive(self, reference: Any, job: Job) -> JobOutcome:
        try:
            returned: _Returned = self.ray.get(reference)
            log = self._keep_log(job, returned.log)
            if returned.outcome.state == JobState.DONE:
                self._write(job, returned.files)
        except (self.ray.exceptions.RayError, ValueError, OSError) as error:
            cause = getattr(error, "cause", None) or error
            text = f"{type(cause).__name__}: {str(cause).partition(chr(10))[0]}"
            return JobOutcome(job, JobState.FAILED, error=text, log=self._keep_log(job, f"{error}\n".encode()))
        return replace(returned.outcome, log=log)

    def _keep_log(self, job: Job, text: bytes) -> Path:
        log = job.log(self.folder)
        log.parent.mkdir(parents=True, exist_ok=True)
        with log.open("ab") as file:
            file.write(text)
        return log

    def _write(self, job: Job, files: dict[str, bytes]) -> None:
        for name in files:
            if name in self.writers:
                raise ValueError(f"it wrote {name}, which is a file of {self.writers[name]}")
        unpack(files, self.folder, job.result)
        self.writers |= dict.fromkeys(files, job.name)

    def _cancel(self) -> Iterator[JobOutcome]:
        """Cancel whatever is under way, as processes on the nodes would go on."""
        for reference in self.jobs:
            self.ray.cancel(reference)
        if self.jobs:
            self.ray.wait(list(self.jobs), num_returns=len(self.jobs), timeout=_PATIENCE)
        for job in self.jobs.values():
            outcome = JobOutcome(job, JobState.INTERRUPTED)
            self.board.on_end(outcome)
            yield outcome


def _import_ray() -> Any:
    try:
        return importlib.import_module("ray")
    except ImportError:
        raise UserError('Ray is not installed; get it with `pip install -c constraints.txt -e ".[ray]"`.') from None


@contextlib.contextmanager
def _connected(ray: Any, address: str) -> Iterator[None]:
    _refuse_silent(address)
    options = {"include_dashboard": False} if address == "local" else {}
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # a cluster of ours tells nobody of it
    try:
        ray.init(address=address, log_to_driver=False, logging_level="ERROR", **options)
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise _no_cluster(address, error) from None
    try:
        yield
    finally:
        ray.shutdown()


def _refuse_silent(address: str) -> None:
    """Refuse an address where nobody listens; Ray itself would try for minutes."""
    host, _, port = address.rpartition(":")
    if port.isdecimal() and "://" not in host:
        try:
            socket.create_connection((host, int(port)), timeout=_PATIENCE).close()
        except (OSError, OverflowError) as error:
            raise _no_cluster(address, error) from None


def _no_cluster(address: str, error: Exception) -> UserError:
    reason = " ".join(str(error).split())
    start = "start one with `ray start --head`, or give local"
    return UserError(f"There is no Ray cluster to work with at {address} ({reason}); {start}.")


def _refuse_too_wide(ray: Any, jobs: Sequence[Job]) -> None:
    most = max(node["Resources"].get("CPU", 0) for node in ray.nodes() if node["Alive"])
    for job in jobs:
        if job.threads > most:
            raise UserError(
                f"{job.name} wants {job.threads} CPUs, but no node of the cluster has more than {most:g}; give it "
                "fewer threads."
            )
