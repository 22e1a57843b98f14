"""Files: others' are read with care, ours are written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import secrets
import socket
import stat
import zlib
from collections.abc import Iterator
from pathlib import Path

from bilateral_rl.io.errors import UserError

_ANY = os.O_RDONLY | os.O_CLOEXEC
_FOUND = _ANY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_NOCTTY
"""Should a pipe or a terminal have taken the place of a file that was found, it is not waited for."""


def read(path: Path, most: int, within: Path | None = None) -> bytes:
    """What a file holds.

    Args:
        path: the file.
        most: bytes that it may have; of a larger one no more than that is ever read.
        within: the folder that it belongs to, which somebody else may have made; None for a file that the user has
            named, be it a pipe.

    Raises:
        FileNotFoundError: it is not there.
        UserError: it is too large or cannot be read, or, as for :func:`find`, is no file of that folder.
    """
    real = path if within is None else find(path, most, within)
    try:
        with os.fdopen(os.open(real, _ANY if within is None else _FOUND), "rb") as file:
            content = file.read(most + 1)
    except FileNotFoundError:
        raise
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None
    if len(content) > most:
        raise _too_large(path, most)
    return content


def find(path: Path, most: int, within: Path) -> Path:
    """Where the file ``path`` of the folder ``within`` really lies; it is not opened.

    Raises:
        FileNotFoundError: it is not there.
        UserError: no regular file, one of more than ``most`` bytes, or one that a link leads out of the folder.
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

    What a process that was killed has left of the same file vanishes too. Once the file has its name, it is on the
    disk: a power cut leaves the old one or the new one. Raises OSError where it cannot be written.
    """
    _remove_left_over(path)
    temporary = path.with_name(f"{_temporary_stem(path)}{os.getpid()}-{secrets.token_hex(4)}")
    os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_CLOEXEC, 0o666))
    try:
        yield temporary
        _flush(temporary)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _temporary_stem(path: Path) -> str:
    """What a temporary file's name begins with: the numbers of processes mean something on one machine only."""
    return f".{path.name}.{zlib.crc32(socket.gethostname().encode()):08x}-"


def _remove_left_over(path: Path) -> None:
    stem = _temporary_stem(path)
    with os.scandir(path.parent) as entries:
        names = [entry.name for entry in entries if entry.name.startswith(stem)]
    for name in names:
        process, dash, _ = name.removeprefix(stem).partition("-")
        if dash and process.isdecimal() and _is_dead(int(process)):
            path.with_name(name).unlink(missing_ok=True)


def _is_dead(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except (PermissionError, OverflowError):  # somebody else's, or no number of a process
        return False
    return False


def _flush(path: Path) -> None:
    handle = os.open(path, _ANY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _too_large(path: Path, most: int) -> UserError:
    return UserError(f"{path} is larger than anything of its kind, {most:,} bytes, and so it is not read.")


def _unreadable(path: Path, error: Exception) -> UserError:
    return UserError(f"Cannot read {path}: {getattr(error, 'strerror', None) or error}.")
