"""The folder of a study, which holds one study and goes on with no other."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import yaml

from bilateral_rl.analysis.goals import JUDGED_RADII
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.config.parse import Values
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import refuse_traps, replacing
from bilateral_rl.io.locks import locked
from bilateral_rl.io.yaml_files import read_settings

STUDY_FILE = "study.yaml"
LOCK = ".lock"
RUNS = "runs"
"""The folder of a study below which its runs lie. A new study may find some that were made elsewhere."""
_BEFORE: Values = {"first_seed": 0, "models": list(MODELS), "subject": "paper", "tasks": list(JUDGED_RADII)}
"""What descriptions by earlier versions do not say, as it was then."""
MACHINE_SETTINGS = ("threads", "device", "track")
"""Settings that change how a run is made, not what comes out: a study may go on with others."""


@contextlib.contextmanager
def new_folder(path: Path) -> Iterator[None]:
    """A context that makes ``path`` and its parents; should it fail, those of them that are still empty vanish again.

    Raises:
        OSError: the folder cannot be made.
    """
    missing = [folder for folder in (path, *path.parents) if not folder.exists()]
    try:
        path.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for folder in missing:
            with contextlib.suppress(OSError):  # not empty, or never made
                folder.rmdir()
        raise


@contextlib.contextmanager
def claimed_folder(folder: Path, study: Values) -> Iterator[None]:
    """A context in which ``folder`` is that of the study that ``study`` describes, and of this process alone.

    If the study is refused in the context before anything of it is done, no trace of it is left.

    Raises:
        UserError: a folder that cannot be written, or not without harm to other things, or that holds another study or
            other things than runs, or that another process is at work in.
    """
    path = folder / STUDY_FILE
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(new_folder(folder))
            refuse_traps(folder)
            if path.is_file():
                _check_same(path, read_settings(path, within=folder), study)
            else:
                stack.enter_context(_new_file(path, yaml.safe_dump(study, sort_keys=False)))
            stack.enter_context(locked(folder / LOCK))  # last: gone before it is asked whether anything else was left
        except TimeoutError:
            raise UserError(
                f"Another command is at work in the study {folder}; wait for its end, or choose another --out."
            ) from None
        except OSError as error:
            raise UserError(f"Cannot write the study {folder}: {error.strerror}. Choose another --out.") from None
        yield


@contextlib.contextmanager
def _new_file(path: Path, text: str) -> Iterator[None]:
    """A context that writes the description of a study; if the study is refused and left nothing else, it vanishes."""
    folder = path.parent
    if _entries(folder) - {RUNS}:
        raise UserError(f"{folder} is not empty and holds no study; choose another --out.")
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    try:
        yield
    except Exception:
        if _entries(folder) - {RUNS} == {path.name}:
            path.unlink()
        raise


def _entries(folder: Path) -> set[str]:
    return {entry.name for entry in folder.iterdir()}


def _check_same(path: Path, stored: Values, requested: Values) -> None:
    stored, requested = _BEFORE | _of_study(stored), _BEFORE | _of_study(requested)
    for name in stored | requested:
        if stored.get(name) != requested.get(name):
            raise UserError(
                f"{path.parent} holds a study with {name} = {stored.get(name)!r}, not {requested.get(name)!r}: "
                "go on with it as it was begun, or choose another --out."
            )


def _of_study(description: Values) -> Values:
    """The description without settings of the machine."""
    overrides = description.get("overrides")
    if not isinstance(overrides, dict):
        return description
    return description | {"overrides": {name: overrides[name] for name in overrides if name not in MACHINE_SETTINGS}}
