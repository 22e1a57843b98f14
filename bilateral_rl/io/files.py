"""Files: those of others are read with care, ours are written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
import stat
from collections.abc import Iterator
from pathlib import Path

from bilateral_rl.io.errors import UserError

_TEMPORARY = ".tmp"


def read(path: Path, most: int, within: Path | None = None) -> bytes:
    """Read a file.

    Args:
        path: the file.
        most: the largest size accepted, in bytes; of a larger file, no more than that is ever read.
        within: the folder that the file belongs to, which somebody else may have made; None for a file that the user
            has named, which may be a pipe.

    Raises:
        FileNotFoundError: the file does not exist.
        UserError: it is too large or cannot be read, or, as for :func:`find`, is no file of that folder.
    """
    real = path if within is None else find(path, most, within)
    try:
        with real.open("rb") as file:
            content = file.read(most + 1)
    except FileNotFoundError:
        raise
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None
    if len(content) > most:
        raise _too_large(path, most)
    return content


def find(path: Path, most: int, within: Path) -> Path:
    """Resolve the file ``path`` of the folder ``within`` to where it really lies, without opening it.

    Raises:
        FileNotFoundError: the file does not exist.
        UserError: it is no regular file, has more than ``most`` bytes, or a link leads out of the folder.
    """
    try:
        real = Path(os.path.realpath(path, strict=True))
        inside = real.is_relative_to(os.path.realpath(within))
        status = real.stat()
    except FileNotFoundError:
        raise
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None
    if not inside:
        raise UserError(f"{path} is a link out of {within}, and what lies there is no part of it.")
    if not stat.S_ISREG(status.st_mode):
        raise UserError(f"{path} is not a regular file, and so it is not read.")
    if status.st_size > most:
        raise _too_large(path, most)
    return real


def refuse_traps(folder: Path) -> None:
    """Raise a UserError if writing below ``folder`` could harm other things: by a link out of it, a pipe, a device."""
    try:
        root = Path(os.path.realpath(folder, strict=True))
        waiting = [root]
        while waiting:
            path = waiting.pop()
            with contextlib.suppress(FileNotFoundError):  # gone by now, as temporary files are
                mode = path.lstat().st_mode
                if stat.S_ISDIR(mode):
                    waiting += path.iterdir()
                elif stat.S_ISLNK(mode):
                    if not Path(os.path.realpath(path)).is_relative_to(root):
                        raise UserError(f"{path} is a link out of {folder}; remove it to write there.")
                elif not stat.S_ISREG(mode):
                    raise UserError(f"{path} is neither a file nor a folder; remove it to write there.")
    except OSError as error:
        raise _unreadable(folder, error) from None


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path beside ``path`` that takes its place at the end, or vanishes if anything fails.

    Once the file has its name, it is on the disk: a power cut leaves the old file or the new one. A process that is
    killed leaves ``.<name>.<random>.tmp``, which nothing reads (:func:`remove_left_over`).

    Raises:
        OSError: the file cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}{_TEMPORARY}")
    temporary.open("xb").close()  # not by ``tempfile``, whose files nobody else may read
    try:
        yield temporary
        with temporary.open("r+b") as file:  # Windows flushes only what could be written
            os.fsync(file.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def remove_left_over(folder: Path) -> None:
    """Remove what killed processes left in ``folder`` itself, where nobody else may be writing."""
    for path in folder.glob(f".*{_TEMPORARY}"):
        with contextlib.suppress(OSError):
            path.unlink()


@contextlib.contextmanager
def removed_if_it_fails(folder: Path) -> Iterator[None]:
    """A context at whose failure, of whatever kind, ``folder`` is removed with all that is in it."""
    try:
        yield
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _too_large(path: Path, most: int) -> UserError:
    return UserError(f"{path} is larger than anything of its kind, {most:,} bytes, and so it is not read.")


def _unreadable(path: Path, error: Exception) -> UserError:
    return UserError(f"Cannot read {path}: {getattr(error, 'strerror', None) or error}.")
