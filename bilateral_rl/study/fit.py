"""Which readings of the paper a study leaves room for, by its profile and its algorithm."""

from __future__ import annotations

from collections.abc import Sequence

from bilateral_rl.analysis.goals import JUDGED_RADII
from bilateral_rl.io.errors import UserError
from bilateral_rl.study.folder import MACHINE_SETTINGS
from bilateral_rl.study.plan import SET_BY_STUDY, Study, is_supervised
from bilateral_rl.study.readings import ALL, Reading, load_readings


def readings_for(study: Study, requested: Sequence[str]) -> tuple[list[Reading], list[str]]:
    """Load readings for a study: of "all", those that it leaves room for; of others, each.

    Args:
        study: the study.
        requested: as :func:`~bilateral_rl.study.readings.load_readings` takes them.

    Returns:
        The readings, and the names of those of "all" that were left out.

    Raises:
        UserError: what cannot be loaded. One that is asked for by its name is not left out, and
            :class:`~bilateral_rl.study.grid.Grid` says why it cannot be.
    """
    named = {reading.name for reading in load_readings([text for text in requested if text != ALL])}
    readings, left_out = [], []
    for reading in load_readings(requested):
        if reading.name in named or _fits(reading, study):
            readings.append(reading)
        else:
            left_out.append(reading.name)
    return readings, left_out


def check_fits(reading: Reading, study: Study) -> None:
    """Raise a UserError if a reading asks for what the study's profile or algorithm leaves no room for."""
    _check_training(reading, study)
    _check_protocol(reading, study)


def _fits(reading: Reading, study: Study) -> bool:
    try:
        check_fits(reading, study)
    except UserError:
        return False
    return True


def _check_training(reading: Reading, study: Study) -> None:
    """Raise a UserError for settings of trainings that are not the reading's to choose."""
    settings = {task: reading.training_of(task) for task in JUDGED_RADII}
    names = {name for values in settings.values() for name in values}
    fixed = [name for name in (*SET_BY_STUDY, "seed", *MACHINE_SETTINGS) if name in names]
    if fixed:
        raise UserError(
            f"The reading {reading.name} cannot change {fixed[0]}, which is the study's to choose; leave it out."
        )
    if names and not is_supervised(study.algo):
        raise UserError(
            f"The reading {reading.name} changes the training by bptt, and this study trains by {study.algo}; leave it "
            "out, or --algo."
        )
    bptt = [values.get("bptt") for values in settings.values()]
    penalty = [one for one in bptt if isinstance(one, dict) and {"penalty", "penalty_coefficient"} & one.keys()]
    if study.profile == "released" and penalty:
        raise _is_fixed(reading, "the weight penalty")


def _check_protocol(reading: Reading, study: Study) -> None:
    """Raise a UserError for lesions, or a retraining, that the study leaves no room for."""
    protocol = reading.protocol
    if study.profile == "released" and (protocol.penalty is not None or protocol.penalty_coefficient is not None):
        raise _is_fixed(reading, "the weight penalty")
    if study.profile == "released" and reading.lesions is not None:
        raise _is_fixed(reading, "the combined lesions")
    for name, used in (("optimizer", protocol.optimizer == "continued"), ("trials", protocol.trials == "training")):
        if used and not is_supervised(study.algo):
            raise UserError(
                f"The reading {reading.name} goes on with the training's {name}, which a training by {study.algo} does "
                "not leave; leave it out, or --algo."
            )


def _is_fixed(reading: Reading, what: str) -> UserError:
    return UserError(
        f"The reading {reading.name} sets {what}, and so does --profile released; leave one of the two out."
    )
