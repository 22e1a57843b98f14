"""A lock that one process holds at a time, and that ends with the process however it ends."""

from __future__ import annotations

import contextlib
import errno
import warnings
from collections.abc import Iterator
from pathlib import Path

from filelock import BaseFileLock, FileLock, SoftFileLock

_NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP)
"""What file systems without ``flock`` may say; at ENOSYS, the library takes a soft lock by itself."""


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """A context in which this process alone holds the lock file ``path``, which is gone afterwards.

    The system ends the lock with the process. Where the file system knows no locks, the file's being there is the lock
    (a soft lock), and one that a killed process left is noticed on its own machine only.

    Raises:
        TimeoutError: another process holds it; no waiting.
        OSError: the file cannot be written, or is a link.
    """
    lock = _acquire(path)
    try:
        yield
    finally:
        with contextlib.suppress(OSError):  # Windows removes no open file, and an empty one does no harm
            path.unlink()  # while it is held: whoever has opened it sees that it is gone, and tries anew
        lock.release()


def _acquire(path: Path) -> BaseFileLock:
    lock: BaseFileLock = FileLock(path, blocking=False)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about the soft lock
            lock.acquire()
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
        lock = SoftFileLock(path, blocking=False)
        lock.acquire()
    return lock
