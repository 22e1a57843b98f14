"""The folder of a study, which holds one and goes on with no other."""

from __future__ import annotations

from pathlib import Path

import yaml

from bilateral_rl.config.parse import Values
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import refuse_traps, replacing
from bilateral_rl.io.yaml_files import read_settings
from bilateral_rl.study.jobs import make_study_folder

STUDY_FILE = "study.yaml"


def claim_folder(folder: Path, study: Values) -> None:
    """Make ``folder`` that of the study that ``study`` describes, or see that it is.

    Raises:
        UserError: a folder that cannot be written, or not without harm to other things, or that holds another study or
            other things.
    """
    make_study_folder(folder)
    refuse_traps(folder)
    path = folder / STUDY_FILE
    if path.is_file():
        _check_same(path, read_settings(path, within=folder), study)
        return
    try:
        if any(folder.iterdir()):
            raise UserError(f"{folder} is not empty and holds no study; choose another --out.")
        with replacing(path) as temporary:
            temporary.write_text(yaml.safe_dump(study, sort_keys=False), encoding="utf-8")
    except OSError as error:
        raise UserError(f"Cannot write the study {folder}: {error.strerror}. Choose another --out.") from None


def _check_same(path: Path, there: Values, wanted: Values) -> None:
    for name in there | wanted:
        if there.get(name) != wanted.get(name):
            raise UserError(
                f"{path.parent} holds a study with {name} = {there.get(name)!r}, not {wanted.get(name)!r}: "
                "go on with it as it was begun, or choose another --out."
            )
