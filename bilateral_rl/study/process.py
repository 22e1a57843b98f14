"""A job in a process of its own, as its supervisor sees it.

It is a plain subprocess because `concurrent.futures.ProcessPoolExecutor` gives up all jobs when one worker is killed
(by the system, for its memory), asks no worker to save, and re-imports the main script; and because its workers, like
those of `multiprocessing`, live on when their parent is killed.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from multiprocessing.connection import Connection, Pipe
from pathlib import Path

from bilateral_rl.study.jobs import Job, JobOutcome, JobState

_ENTRY = Path(__file__).with_name("entry.py")
_THREAD_LIMITS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")

Report = tuple[float, str]
"""How much is done, from 0 to 1, and a few words on it."""


class JobProcess:
    """A process that does a job. It ends by itself, by :meth:`kill`, or with the process that started it.

    It has a session of its own, so that Ctrl-C reaches it through :meth:`interrupt` alone, and once.

    Args:
        job: what to do.
        folder: the study's.
        log: file to which everything that the job prints is appended.

    Attributes:
        pipe: readable when :meth:`reports` has something to return, None after its end.
    """

    def __init__(self, job: Job, folder: Path, log: Path) -> None:
        self.job = job
        self._folder, self._log, self._began = folder, log, time.monotonic()
        self._error: str | None = None
        log.parent.mkdir(parents=True, exist_ok=True)
        this_end, job_end = Pipe()
        self.pipe: Connection | None = this_end
        with log.open("ab") as output, job_end:
            output.write(f"--- {job.name}, {time.strftime('%Y-%m-%d %H:%M:%S')}\n".encode())
            output.flush()
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-u", str(_ENTRY), str(job_end.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                pass_fds=[job_end.fileno()],
                env=os.environ | dict.fromkeys(_THREAD_LIMITS, str(job.threads)),
                start_new_session=True,
            )
        path = [entry or str(Path.cwd()) for entry in sys.path]
        with contextlib.suppress(OSError):  # it is dead already, and its exit code says why
            this_end.send(
                {"path": path, "folder": str(folder.resolve()), "work": job.work, "arguments": dict(job.arguments)}
            )

    @property
    def ended(self) -> bool:
        """Whether the process has ended."""
        return self._process.poll() is not None

    def reports(self) -> list[Report]:
        """Return the job's reports since the last call."""
        reports = []
        while self.pipe is not None and self.pipe.poll():
            try:
                kind, *values = self.pipe.recv()
            except (EOFError, OSError):  # at its end, or killed within a message
                self.pipe.close()
                self.pipe = None
            else:
                if kind == "error":
                    (self._error,) = values
                else:
                    reports.append(tuple(values))
        return reports

    def interrupt(self) -> None:
        """Ask it to save and stop."""
        self._process.send_signal(signal.SIGINT)

    def kill(self) -> None:
        """End it and all that it started, at once."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def outcome(self, interrupted: bool = False) -> JobOutcome:
        """Wait for the end of the job, and return how it ended; ``interrupted`` says that it was asked to stop."""
        code = self._process.wait()
        self.reports()
        state, error = JobState.FAILED, None
        if self.job.is_done(self._folder):
            state = JobState.DONE
        elif interrupted:
            state = JobState.INTERRUPTED
        else:
            error = self._error or _why(code, self.job)
        return JobOutcome(self.job, state, time.monotonic() - self._began, error, self._log)


def _why(code: int, job: Job) -> str:
    if code == 0:
        return f"it ended without writing {job.result}"
    if code == -signal.SIGKILL:
        return "killed (SIGKILL); perhaps there was too little memory"
    if code < 0:
        return f"killed by {signal.Signals(-code).name}"
    return f"it left with exit code {code}"
