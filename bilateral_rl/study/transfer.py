"""Files of a job on their way from one machine to another."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

from bilateral_rl.study.jobs import is_inside


def pack(folder: Path) -> dict[str, bytes]:
    """Read every file below ``folder``, by its relative name; links are not followed."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def unpack(files: Mapping[str, bytes], folder: Path, last: str) -> None:
    """Write ``files`` below ``folder``, in the place of existing ones; nothing moves before all are on the disk.

    Args:
        files: contents, by relative name.
        folder: an existing one.
        last: name of the file that takes its place after all others.

    Raises:
        ValueError: a name that leaves the folder; nothing is written then.
    """
    strays = [name for name in files if not is_inside(name)]
    if strays:
        raise ValueError(f"{strays[0]!r} is not a file below the study's folder")
    with tempfile.TemporaryDirectory(dir=folder, prefix=".arriving-") as arrived:
        for name, content in files.items():
            path = Path(arrived, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        for name in sorted(files, key=lambda name: name == last):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            Path(arrived, name).replace(folder / name)
