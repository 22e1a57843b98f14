"""The files: their colors, and that they are whole or not there."""

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from bilateral_rl.io.errors import UserError
from bilateral_rl.video import files
from bilateral_rl.video import film as film_module

SIZE = 320
CAPTION = SIZE // 8
"""Rows of a picture that hold its caption."""
STEPS, PAUSE = 20, 15
"""Of the small supervised runs; and the pictures of a pause of 0.6 s at 25 a second."""


def gif_pictures(path):
    with Image.open(path) as image:
        return [np.array(image.convert("RGB")) for i in range(image.n_frames) if image.seek(i) is None]


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_muscles_redden_with_their_activation_in_the_file(tmp_path, suffix, make_record, make_film, decode):
    activation = np.zeros((1, 3, 6), np.float32)
    activation[0, :, 0] = 0.0, 0.5, 1.0
    film = make_film(make_record(steps=3, activation=activation))
    path = tmp_path / f"video{suffix}"
    files.write(path, film, film, "")
    drawn = [film.picture(0, step)[CAPTION:] for step in (1, 2, 3)]
    muscle = (drawn[0] != drawn[2]).any(axis=-1) & (drawn[2] == (103, 0, 13)).all(axis=-1)
    assert muscle.sum() > 60
    pictures = decode(path)[1] if suffix == ".mp4" else gif_pictures(path)
    colors = np.array([picture[CAPTION:][muscle].mean(axis=0) for picture in pictures[1:4]])
    np.testing.assert_allclose(colors, [(255, 245, 240), (251, 106, 74), (103, 0, 13)], atol=25)


@pytest.mark.parametrize("content", [b"", b"somebody's holiday"])
def test_refuses_to_replace_a_file_of_others(show, bptt_run, tmp_path, content):
    other = tmp_path / "video.mp4"
    other.write_bytes(content)
    with pytest.raises(UserError, match="was not written by `bilateral-rl render`"):
        show(bptt_run.path, out=other)
    assert other.read_bytes() == content


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_an_earlier_video_is_replaced(show, bptt_run, unilateral, tmp_path, suffix, make_record, make_film):
    out = tmp_path / f"video{suffix}"
    film = make_film(make_record(steps=1))
    files.write(out, film, film, "somewhere/cc_s-bptt-1")
    first = out.read_bytes()
    assert b"bilateral-rl render somewhere/cc_s-bptt-1" in first  # it says what it shows
    show(unilateral, out=out)
    assert out.read_bytes() != first
    assert f"bilateral-rl render {unilateral} --trials 1 --seed 7".encode() in out.read_bytes()


def test_drawing_that_is_interrupted_leaves_the_earlier_video(
    show, bptt_run, tmp_path, monkeypatch, make_record, make_film, tree
):
    film = make_film(make_record(steps=1))
    files.write(tmp_path / "video.mp4", film, film, "")
    drawn = film_module.draw
    left = iter(range(5))

    def interrupted(*scene):
        if next(left, None) is None:
            raise KeyboardInterrupt
        return drawn(*scene)

    monkeypatch.setattr(film_module, "draw", interrupted)
    before = tree(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        show(f"{bptt_run.path}:1")
    assert tree(tmp_path) == before


def test_an_ffmpeg_that_fails_is_said_and_leaves_nothing(tmp_path, monkeypatch, capfd, make_record, make_film, tree):
    monkeypatch.setattr(files, "_MP4", ("-f", "mp4", "-vf", "nonsense"))
    film = make_film(make_record())
    with pytest.raises(UserError, match="ffmpeg failed"):
        files.write(tmp_path / "video.mp4", film, film, "")
    assert not tree(tmp_path)


def test_a_video_that_lacks_pictures_is_not_kept(tmp_path, make_record, make_film, tree):
    film = make_film(make_record())
    with pytest.raises(UserError, match="ffmpeg failed"):
        files.write(tmp_path / "video.mp4", film, list(film)[:-1], "")
    assert not tree(tmp_path)


def test_without_ffmpeg_a_gif_is_proposed(tmp_path, monkeypatch, make_record, make_film, tree):
    def missing():
        raise RuntimeError("No ffmpeg exe could be found.")

    monkeypatch.setattr(imageio_ffmpeg, "get_ffmpeg_exe", missing)
    film = make_film(make_record())
    with pytest.raises(UserError, match=r"NAME\.gif"):
        files.write(tmp_path / "video.mp4", film, film, "")
    files.write(tmp_path / "video.gif", film, film, "")
    assert list(tree(tmp_path)) == [tmp_path / "video.gif"]


def test_a_gif_lasts_as_long_and_loops(show, bptt_run, tmp_path):
    path = show(f"{bptt_run.path}:0", out=tmp_path / "arm.GIF", trials=2).path
    with Image.open(path) as image:
        durations = [image.info["duration"] for i in range(image.n_frames) if image.seek(i) is None]
        assert image.size == (SIZE, SIZE)
        assert image.info["loop"] == 0
    assert sum(durations) == 2 * (STEPS + 1 + PAUSE) * 40
    assert durations[0] == 40
    assert max(durations) == (1 + PAUSE) * 40
    assert (gif_pictures(path)[0][-1, SIZE // 2] == 255).all()  # white stays white
