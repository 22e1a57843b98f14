"""What the process of a job runs: this file alone, by its path, so that nothing is imported but what the job imports.

A pipe to the process that started this one brings the job and takes the reports; its end says that the other is no
more.
"""

from __future__ import annotations

import contextlib
import faulthandler
import importlib
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path

INTERVAL = 0.2
"""Seconds between two reports that differ in their numbers only."""


def main() -> int:
    """Do the job that comes through the pipe, and return the exit code."""
    faulthandler.enable()
    pipe = Connection(int(sys.argv[1]))
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    job = pipe.recv()
    threading.Thread(target=_end_with, args=(pipe,), daemon=True).start()  # blocks SIGINT, so that it wakes this thread
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    signal.signal(signal.SIGINT, signal.default_int_handler)  # shells let background processes ignore it
    try:
        sys.path[:] = job["path"]
        module, _, name = job["work"].partition(":")
        work = getattr(importlib.import_module(module), name)
        work(Path(job["folder"]), _progress(pipe), **job["arguments"])
    except KeyboardInterrupt:
        print("Interrupted.")
        return 130
    except Exception as error:
        traceback.print_exc()
        pipe.send(("error", _in_one_line(error)))
        return 1
    return 0


def _progress(pipe: Connection) -> Callable[[float, str], None]:
    """The job's progress, sent through ``pipe``, but not so often that its reader has work with it."""
    sent_at, sent_text = -INTERVAL, ""

    def progress(done: float, text: str) -> None:
        nonlocal sent_at, sent_text
        now = time.monotonic()
        if text != sent_text or now - sent_at >= INTERVAL:
            pipe.send(("progress", float(done), text))
            sent_at, sent_text = now, text

    return progress


def _end_with(pipe: Connection) -> None:
    """Wait for the end of the process at the other end, then end this one and all that it started."""
    with contextlib.suppress(EOFError, OSError):
        pipe.recv()  # nothing else comes
    os.killpg(0, signal.SIGKILL)  # this process leads its group


def _in_one_line(error: Exception) -> str:
    text = " ".join(str(error).split())
    if type(error).__name__ == "UserError":  # not imported: it is a sentence for people as it is
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


if __name__ == "__main__":
    sys.exit(main())
