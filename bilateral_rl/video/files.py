"""Films as files: MP4 that browsers and phones play, or GIF; whole or not at all."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import closing
from pathlib import Path

import imageio_ffmpeg
from PIL import Image

from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import replacing
from bilateral_rl.video.film import Film, Picture

SUFFIXES = (".mp4", ".gif")
MARK = "bilateral-rl render"
"""Beginning of the comment in a video's metadata, by which a video is known as one that may be replaced."""

_MARK_WITHIN = 2**20
"""Bytes from a file's start within which both formats, as written here, keep their metadata."""
_MP4 = (
    *("-f", "mp4"),  # the temporary file's name does not say so
    *("-threads", "1"),
    *("-movflags", "+faststart"),
    # Colors as players take for granted, and said so, or reds would shift.
    *("-vf", "scale=out_color_matrix=bt709,setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709"),
)
_QUALITY = 7.0  # of imageio-ffmpeg's 0 to 10: thin lines stay clean


def check_path(path: Path) -> None:
    """Raise a UserError unless ``path`` has a suffix that can be written, and is free or an earlier video of ours."""
    if path.suffix.lower() not in SUFFIXES:
        raise UserError(f"A video's name ends in {' or '.join(SUFFIXES)}, got {path}: choose another --out.")
    try:
        is_there = path.exists() or path.is_symlink()  # a broken link would be written through
        if is_there and not (path.is_file() and _is_ours(path)):
            raise UserError(f"{path} exists and was not written by `{MARK}`: choose another --out, or remove it.")
    except OSError as error:
        raise UserError(f"Cannot write {path}: {error.strerror}; choose another --out.") from None


def write(path: Path, film: Film, pictures: Iterable[Picture], note: str) -> None:
    """Write a film.

    Args:
        path: a path that :func:`check_path` allows.
        film: the film.
        pictures: its pictures in order: the film itself, or an iterator that counts them as they pass.
        note: comment for the metadata, after :data:`MARK`.

    Raises:
        UserError: the file cannot be written.
    """
    make = _write_gif if path.suffix.lower() == ".gif" else _write_mp4
    try:
        with replacing(path.resolve()) as temporary:
            make(temporary, film, pictures, f"{MARK} {note}")
    except OSError as error:
        raise UserError(f"Cannot write {path}: {error.strerror or 'ffmpeg failed'}; choose another --out.") from error


def _write_mp4(path: Path, film: Film, pictures: Iterable[Picture], comment: str) -> None:
    _require_ffmpeg()
    height, width = film.shape
    writer = imageio_ffmpeg.write_frames(
        str(path),
        (width, height),
        fps=film.fps,
        quality=_QUALITY,
        codec="libx264",
        macro_block_size=2,  # of yuv420p, or it would resize
        ffmpeg_log_level="error",
        input_params=["-threads", "1"],
        output_params=[*_MP4, "-metadata", f"comment={comment}"],
    )
    with closing(writer):
        writer.send(None)
        for picture in pictures:
            writer.send(picture)
    _check_complete(path, len(film))


def _require_ffmpeg() -> None:
    try:
        imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError:
        raise UserError("There is no ffmpeg on this machine: install it, or write a GIF by --out NAME.gif.") from None


def _check_complete(path: Path, n_pictures: int) -> None:
    """Raise OSError unless all pictures are in the file: ffmpeg does not tell how it ended, on a full disk say."""
    try:
        written, _ = imageio_ffmpeg.count_frames_and_secs(str(path))
    except RuntimeError:
        written = 0
    if written != n_pictures:
        raise OSError(f"{written} of {n_pictures} pictures were written")


def _write_gif(path: Path, film: Film, pictures: Iterable[Picture], comment: str) -> None:
    paletted = _palette_of(film.colorful())
    images = (paletted(picture) for picture in pictures)
    next(images).save(
        path,
        format="GIF",
        save_all=True,
        append_images=images,
        duration=1000 / film.fps,
        loop=0,
        comment=comment,
    )


def _palette_of(picture: Picture) -> Callable[[Picture], Image.Image]:
    """Return what reduces pictures to the 256 colors of this one: with a palette each, they would flicker."""
    palette = Image.fromarray(picture).quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=1)

    def reduced(image: Picture) -> Image.Image:
        return Image.fromarray(image).quantize(palette=palette, dither=Image.Dither.NONE)

    # Pillow looks colors up to the nearest 4 of 256, so that the white corner may have become grey.
    corner = reduced(picture).getpixel((0, 0))
    assert isinstance(corner, int)
    colors = palette.getpalette() or []
    colors[3 * corner : 3 * corner + 3] = picture[0, 0].tolist()

    def paletted(image: Picture) -> Image.Image:
        result = reduced(image)
        result.putpalette(colors)
        return result

    return paletted


def _is_ours(path: Path) -> bool:
    with path.open("rb") as file:
        return MARK.encode() in file.read(_MARK_WITHIN)
