"""The process of one seed of a run: ``python -m bilateral_rl.training.one_seed FOLDER``.

It trains, or goes on with, the run FOLDER, whose configuration lies there. Standard output carries messages, a JSON
object a line (:data:`Message`); the end of standard input asks it to save and stop: either the run is stopped, or the
process that started this one has ended.
"""

from __future__ import annotations

import _thread
import contextlib
import json
import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any, BinaryIO, TextIO, cast

from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.training.learner import Diverged
from bilateral_rl.training.progress import Progress
from bilateral_rl.training.run import train_in

Message = dict[str, Any]
"""``{"done": n}``, ``{"done": n, "measures": {…}}``, and at the end ``{"notes": […]}`` or ``{"error": "sentence"}``."""

_INTERVAL = 0.2
"""Seconds between two messages that differ in their number only."""


class MessageProgress(Progress):
    """Sends messages, but not so often that their reader has work with them.

    Args:
        output: an unbuffered pipe.
    """

    def __init__(self, output: BinaryIO) -> None:
        self._output, self._sent = output, -_INTERVAL

    def on_start(self, done: int) -> None:
        self.send({"done": done})

    def on_step(self, done: int) -> None:
        if time.monotonic() - self._sent >= _INTERVAL:
            self.send({"done": done})

    def on_evaluation(self, done: int, measures: dict[str, float]) -> None:
        self.send({"done": done, "measures": measures})

    def send(self, message: Message) -> None:
        """Write one message, if there is still somebody to read it."""
        self._sent = time.monotonic()
        # Should the process that started this one have ended, standard input says so, and all is saved before the end.
        with contextlib.suppress(OSError):
            self._output.write(f"{json.dumps(message)}\n".encode())


def main() -> int:
    """Train the run that the arguments name; the exit code."""
    # Whatever prints something goes to the error stream, and not among the messages.
    output = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # shells let background processes ignore it
    progress = MessageProgress(cast(BinaryIO, output))
    try:
        threading.Thread(target=_stop_at_the_end_of, args=(sys.stdin,), daemon=True).start()
        outcome = train_in(RunFolder.open(Path(sys.argv[1])), progress)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # it is over, and what asks it to stop comes too late
        progress.send({"done": outcome.done, "notes": outcome.notes})
    except UserError as error:
        divergence = error.__cause__  # without what follows it, which the run itself says of all its seeds
        progress.send({"error": str(divergence if isinstance(divergence, Diverged) else error)})
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


def _stop_at_the_end_of(stream: TextIO) -> None:
    stream.read()
    _thread.interrupt_main()


if __name__ == "__main__":
    sys.exit(main())
