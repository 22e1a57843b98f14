import pytest

from bilateral_rl.study.transfer import pack, unpack


def contents(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_files_arrive_as_they_left(tmp_path):
    files = {"runs/a/weights": bytes(range(256)), "runs/a/.hidden": b"", "result.csv": b"1\n"}
    sent, received = tmp_path / "sent", tmp_path / "received"
    for name, content in files.items():
        (sent / name).parent.mkdir(parents=True, exist_ok=True)
        (sent / name).write_bytes(content)
    (sent / "link").symlink_to("/etc/passwd")
    (received / "runs" / "a").mkdir(parents=True)
    (received / "runs" / "a" / "weights").write_bytes(b"of an interrupted job")
    (received / "other").write_bytes(b"of another job")
    unpack(pack(sent), received, "result.csv")
    assert contents(received) == files | {"other": b"of another job"}
    assert not list(received.glob(".arriving-*"))


@pytest.mark.parametrize("name", ["/etc/x", "../x", "a/../../x", ""])
def test_a_name_that_leaves_the_folder_is_refused_and_nothing_is_written(tmp_path, name):
    folder = tmp_path / "study"
    folder.mkdir()
    with pytest.raises(ValueError, match="not a file below"):
        unpack({"good": b"", name: b""}, folder, "good")
    assert contents(tmp_path) == {}


def test_the_result_takes_its_place_last(tmp_path):
    (tmp_path / "z").mkdir()  # a folder where a file should go
    with pytest.raises(OSError, match="z"):
        unpack({"a.csv": b"result", "b": b"", "z": b""}, tmp_path, "a.csv")
    assert contents(tmp_path) == {"b": b""}
