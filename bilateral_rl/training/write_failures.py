"""A training that cannot write any more, because the disk is full or the folder read-only, ends with a sentence."""

from __future__ import annotations

import contextlib
import shlex
import threading
from collections.abc import Iterator

from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder


@contextlib.contextmanager
def explaining_write_failures(folder: RunFolder) -> Iterator[None]:
    """A context in which what cannot be written raises a UserError: why, what is saved, and how to go on."""
    with _quiet_writers():
        try:
            yield
        except OSError as error:
            raise UserError(
                f"Cannot write {folder.path}: {error.strerror or error}. The training stopped. {_what_is_saved(folder)}"
            ) from error


def _what_is_saved(folder: RunFolder) -> str:
    if not (folder.path / "resume.safetensors").exists():
        return "Nothing was saved yet; start anew once there is room, or with another --out."
    status = folder.status()
    done = f"{status['epochs']:,} epochs" if "epochs" in status else f"{status.get('timesteps', 0):,} steps"
    return (
        f"Its state after {done} is saved; once the folder can be written, go on with "
        f"`bilateral-rl train --resume {shlex.quote(str(folder.path))}`."
    )


@contextlib.contextmanager
def _quiet_writers() -> Iterator[None]:
    """Tensorboard's thread prints no traceback where it cannot write: its next caller is told anyway."""
    before = threading.excepthook

    def hook(failure: threading.ExceptHookArgs) -> None:
        if not issubclass(failure.exc_type, OSError):
            before(failure)

    threading.excepthook = hook
    try:
        yield
    finally:
        threading.excepthook = before
