"""Which readings a study leaves room for, by what it is about, its profile and its algorithm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from bilateral_rl.analysis.goals import JUDGED_RADII
from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.config.catalogue import ALGORITHMS
from bilateral_rl.io.errors import UserError
from bilateral_rl.study.folder import MACHINE_SETTINGS
from bilateral_rl.study.plan import SET_BY_STUDY, Study, is_supervised
from bilateral_rl.study.reading_files import ALL, ReadingFiles
from bilateral_rl.study.reading_tables import AnyReading
from bilateral_rl.study.readings import ANCHORS, FILES, Reading
from bilateral_rl.study.two_arms.readings import HAND_FILES, HandReading, usual_readings


def readings_for(study: Study, requested: Sequence[str] | None) -> tuple[Sequence[AnyReading], list[str]]:
    """Load readings for a study: of "all", those that it leaves room for; of others, each.

    Args:
        study: the study.
        requested: as :meth:`~bilateral_rl.study.reading_files.ReadingFiles.load` takes them; None for the usual ones:
            the anchors of the paper, or those of two arms that need no other trainings.

    Returns:
        The readings, and the names of those of "all" that were left out.

    Raises:
        UserError: what cannot be loaded. One that is asked for by its name is not left out, and
            :class:`~bilateral_rl.study.grid.Grid` says why it cannot be.
    """
    if study.subject == "two_arms":
        return _fitting(study, HAND_FILES, requested or usual_readings())
    return _fitting(study, FILES, requested or ANCHORS)


def _fitting(
    study: Study, files: ReadingFiles[Any], requested: Sequence[str]
) -> tuple[Sequence[AnyReading], list[str]]:
    named = {reading.name for reading in files.load([text for text in requested if text != ALL])}
    readings, left_out = [], []
    for reading in files.load(requested):
        if reading.name in named or _fits(reading, study):
            readings.append(reading)
        else:
            left_out.append(reading.name)
    return readings, left_out


def check_fits(reading: AnyReading, study: Study) -> None:
    """Raise a UserError if a reading asks for what the study's profile or algorithm leaves no room for."""
    _check_fixed(reading, study)
    if isinstance(reading, HandReading):
        _check_algorithm(reading, study)
        for protocol in (reading.callosum, reading.deep):
            _check_protocol(reading, protocol, study)
        return
    _check_training(reading, study)
    _check_protocol(reading, reading.protocol, study)
    if study.profile == "released" and reading.lesions is not None:
        raise _is_fixed(reading, "the combined lesions")


def _fits(reading: AnyReading, study: Study) -> bool:
    try:
        check_fits(reading, study)
    except UserError:
        return False
    return True


def _check_fixed(reading: AnyReading, study: Study) -> None:
    """Raise a UserError for settings of trainings that are not the reading's to choose."""
    names = {name for task in study.tasks for name in reading.training_of(task)}
    fixed = [name for name in (*SET_BY_STUDY, "seed", *MACHINE_SETTINGS) if name in names]
    if fixed:
        raise UserError(
            f"The reading {reading.name} cannot change {fixed[0]}, which is the study's to choose; leave it out."
        )


def _check_algorithm(reading: HandReading, study: Study) -> None:
    """Raise a UserError for settings of the training by another algorithm than the study's."""
    named = {name for task in study.tasks for name in reading.training_of(task)} & ALGORITHMS.keys()
    if named - {study.algo}:
        raise UserError(
            f"The reading {reading.name} changes the training by {', '.join(sorted(named))}, and this study trains by "
            f"{study.algo}; leave it out, or --algo."
        )


def _check_training(reading: Reading, study: Study) -> None:
    """Raise a UserError for settings of trainings that the study's algorithm or profile leaves no room for."""
    settings = {task: reading.training_of(task) for task in JUDGED_RADII}
    names = {name for values in settings.values() for name in values}
    if names and not is_supervised(study.algo):
        raise UserError(
            f"The reading {reading.name} changes the training by bptt, and this study trains by {study.algo}; leave it "
            "out, or --algo."
        )
    bptt = [values.get("bptt") for values in settings.values()]
    penalty = [one for one in bptt if isinstance(one, dict) and {"penalty", "penalty_coefficient"} & one.keys()]
    if study.profile == "released" and penalty:
        raise _is_fixed(reading, "the weight penalty")


def _check_protocol(reading: AnyReading, protocol: Protocol, study: Study) -> None:
    """Raise a UserError for a retraining that the study leaves no room for."""
    if study.profile == "released" and (protocol.penalty is not None or protocol.penalty_coefficient is not None):
        raise _is_fixed(reading, "the weight penalty")
    for name, used in (("optimizer", protocol.optimizer == "continued"), ("trials", protocol.trials == "training")):
        if used and not is_supervised(study.algo):
            raise UserError(
                f"The reading {reading.name} goes on with the training's {name}, which a training by {study.algo} does "
                "not leave; leave it out, or --algo."
            )


def _is_fixed(reading: AnyReading, what: str) -> UserError:
    return UserError(
        f"The reading {reading.name} sets {what}, and so does --profile released; leave one of the two out."
    )
