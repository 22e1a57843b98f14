"""A lock that one process holds at a time, and that ends with the process however it ends."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """A context in which this process alone holds the lock file ``path``, which is gone afterwards.

    The system ends the lock with the process. Where the file system knows no locks, the file's existence is the lock
    (a *soft* lock), and the file of a killed process is taken over on the same machine only.

    Raises:
        TimeoutError: another process holds the lock; it is not waited for.
        OSError: the file cannot be written, or is a link.
    """
    from filelock import FileLock  # a tenth of a second, which listing runs does without

    lock = FileLock(path, blocking=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about the soft lock
        lock.acquire()
    try:
        yield
    finally:
        with contextlib.suppress(OSError):  # Windows removes no open file, and an empty one does no harm
            path.unlink()  # while it is held: whoever has opened it sees that it is gone, and tries anew
        lock.release()
