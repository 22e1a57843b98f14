"""Files: others' are read with care, ours are written whole or not at all."""

import errno
import multiprocessing
import os
import resource
import signal
import stat
from pathlib import Path

import pytest

from bilateral_rl.io import files
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import find, read, refuse_traps, remove_left_over, replacing


@pytest.fixture
def folder(tmp_path):
    path = tmp_path / "folder"
    path.mkdir()
    return path


# Reading


def test_a_file_of_the_folder_is_read_whatever_the_way_to_it(folder, tmp_path):
    (folder / "file").write_bytes(b"content")
    (folder / "link").symlink_to("file")
    (tmp_path / "way").symlink_to(folder)
    os.link(folder / "file", folder / "hard")
    for name in ("file", "link", "hard"):
        assert read(folder / name, 7, folder) == b"content"
        assert read(tmp_path / "way" / name, 7, tmp_path / "way") == b"content"
    assert find(tmp_path / "way/link", 7, folder) == folder / "file"


def test_what_is_larger_than_it_may_be_is_not_read_without_end(folder):
    (folder / "file").write_bytes(b"content")
    without_size = Path("/proc/self/status")  # says that it is empty
    for path, within in ((folder / "file", folder), (folder / "file", None), (without_size, without_size.parent)):
        with pytest.raises(UserError, match="larger than anything of its kind, 6 bytes"):
            read(path, 6, within)


@pytest.mark.parametrize("name", ["nothing", "link", "file/below"])
def test_what_is_not_there_is_told_from_what_is_refused(folder, name):
    (folder / "file").touch()
    (folder / "link").symlink_to("nothing")
    expected = UserError if name == "file/below" else FileNotFoundError
    for within in (folder, None):
        with pytest.raises(expected):
            read(folder / name, 100, within)


@pytest.mark.parametrize("name", ["../outside", "out", "way/outside", "\0", "x" * 300, "\ud800", "loop", "pipe", "way"])
def test_what_lies_elsewhere_or_is_no_file_is_refused(folder, tmp_path, name):
    (tmp_path / "outside").write_text("secret")
    (folder / "out").symlink_to(tmp_path / "outside")
    (folder / "way").symlink_to("..")
    (folder / "loop").symlink_to("loop")
    os.mkfifo(folder / "pipe")
    with pytest.raises(UserError):
        read(folder / name, 100, folder)


# Before writing


def test_links_within_a_folder_are_no_traps_but_others_are_however_deep(folder):
    (folder / "below").mkdir()
    (folder / "below/file").touch()
    (folder / "link").symlink_to("below/file")
    (folder / "below/up").symlink_to("..")
    (folder / "nowhere").symlink_to("below/nothing")
    refuse_traps(folder)
    deep = folder.joinpath(*["d"] * 100)
    deep.mkdir(parents=True)
    for target in ("/etc/passwd", "../" * 101 + "nothing"):
        (deep / "trap").symlink_to(target)
        with pytest.raises(UserError, match="is a link out of"):
            refuse_traps(folder)
        (deep / "trap").unlink()
    os.mkfifo(deep / "trap")
    with pytest.raises(UserError, match="neither a file nor a folder"):
        refuse_traps(folder)


# Writing


def test_what_fails_leaves_the_old_file_and_nothing_else(folder):
    (folder / "file").write_text("old")

    def fail():
        with replacing(folder / "file") as temporary:
            temporary.write_text("ne")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert [(path.name, path.read_text()) for path in folder.iterdir()] == [("file", "old")]


def test_a_new_file_has_the_mode_of_any_other(folder):
    before = os.umask(0o027)
    try:
        with replacing(folder / "file") as temporary:
            temporary.write_text("new")
    finally:
        os.umask(before)
    assert stat.S_IMODE((folder / "file").stat().st_mode) == 0o640


def test_a_link_is_replaced_and_not_written_through(folder, tmp_path):
    (tmp_path / "outside").write_text("mine")
    (folder / "file").symlink_to(tmp_path / "outside")
    with replacing(folder / "file") as temporary:
        temporary.write_text("new")
    assert (tmp_path / "outside").read_text() == "mine"
    assert not (folder / "file").is_symlink()


def test_a_file_is_on_the_disk_before_it_has_its_name(folder, monkeypatch):
    flushed = []

    def fsync(handle):
        flushed.append((os.fstat(handle).st_size, (folder / "file").exists()))

    monkeypatch.setattr(files.os, "fsync", fsync)
    with replacing(folder / "file") as temporary:
        temporary.write_text("content")
    assert flushed == [(7, False)]


def _write_and_wait(path, ready):
    with replacing(path) as temporary:
        temporary.write_text("half")
        ready.set()
        signal.pause()


def test_what_a_killed_process_left_is_recognized_and_removed_where_nobody_else_writes(folder):
    context = multiprocessing.get_context("fork")
    ready = context.Event()
    process = context.Process(target=_write_and_wait, args=(folder / "below/file", ready))
    (folder / "below").mkdir()
    (folder / ".hidden").touch()
    process.start()
    ready.wait()
    process.kill()
    process.join()
    (left,) = (folder / "below").iterdir()
    assert left.read_text() == "half"
    assert left.match(".file.*.tmp")
    remove_left_over(folder)
    assert left.exists()
    remove_left_over(folder / "below")
    assert {path.name for path in folder.rglob("*")} == {"below", ".hidden"}


def test_a_full_disk_is_an_error_of_the_system_and_leaves_nothing(folder):
    """The disk is full for this process: no file may be larger than this."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(OSError, match=os.strerror(errno.EFBIG)), replacing(folder / "file") as temporary:
            temporary.write_bytes(bytes(1001))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, before)
    assert not list(folder.iterdir())


def test_a_folder_that_is_not_there_is_an_error_of_the_system(folder):
    with pytest.raises(FileNotFoundError), replacing(folder / "none/file"):
        pass
