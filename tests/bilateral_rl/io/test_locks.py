"""A lock is held by one process, ends with it however it ends, and needs no file system that knows locks."""

import contextlib
import errno
import fcntl
import multiprocessing
import os
import signal
import time

import pytest

from bilateral_rl.io.locks import locked


@pytest.fixture(params=[True, False], ids=["locks", "no locks"])
def path(request, tmp_path, monkeypatch):
    """A lock file, on a file system that knows locks and on one that does not."""

    def flock(*_):
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))

    if not request.param:
        monkeypatch.setattr(fcntl, "flock", flock)
    return tmp_path / ".lock"


def test_one_holds_it_and_nothing_is_left(path):
    for _ in range(2):
        with locked(path), pytest.raises(TimeoutError), locked(path):
            pass
    with pytest.raises(ZeroDivisionError), locked(path):
        1 / 0  # noqa: B018
    assert not path.exists()


def _hold(path, ready):
    with locked(path):
        ready.set()
        signal.pause()


def test_it_ends_with_a_killed_process(path):
    context = multiprocessing.get_context("fork")
    ready = context.Event()
    process = context.Process(target=_hold, args=(path, ready))
    process.start()
    assert ready.wait(20)
    with pytest.raises(TimeoutError), locked(path):
        pass
    process.kill()
    process.join()
    for _ in range(100):  # whether a soft lock is just being made is looked at for two seconds
        with contextlib.suppress(TimeoutError), locked(path):
            break
        time.sleep(0.05)
    else:
        pytest.fail("the lock of a dead process holds")
    assert not path.exists()


def _count_up(lock, count, times):
    for _ in range(times):
        while True:
            try:
                with locked(lock):
                    count.write_text(str(int(count.read_text()) + 1))
                break
            except TimeoutError:
                time.sleep(0.0005)


def test_what_one_reads_and_writes_under_it_no_other_changes_in_between(path):
    count = path.with_name("count")
    count.write_text("0")
    context = multiprocessing.get_context("fork")
    processes = [context.Process(target=_count_up, args=(path, count, 30)) for _ in range(4)]
    for process in processes:
        process.start()
    for process in processes:
        process.join(60)
    assert count.read_text() == "120"


@pytest.mark.parametrize("make", [lambda path: path.symlink_to("file"), lambda path: path.mkdir()])
def test_what_is_no_lock_is_an_error_of_the_system(tmp_path, make):
    (tmp_path / "file").write_text("mine")
    make(tmp_path / ".lock")
    with pytest.raises(OSError) as error, locked(tmp_path / ".lock"):  # noqa: PT011 - loops and folders differ
        pass
    assert not isinstance(error.value, TimeoutError)
    assert (tmp_path / "file").read_text() == "mine"


def test_what_lies_in_its_place_keeps_its_content(tmp_path):
    """Another name of a file that is somebody's is not emptied."""
    (tmp_path / "file").write_text("mine")
    os.link(tmp_path / "file", tmp_path / ".lock")
    with locked(tmp_path / ".lock"):
        pass
    assert (tmp_path / "file").read_text() == "mine"
