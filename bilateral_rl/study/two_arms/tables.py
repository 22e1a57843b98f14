"""The tables of results that a reading of two arms asks for of a training: after which lesions, with which spring."""

from __future__ import annotations

from collections.abc import Iterator

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.claims.two_arms.evidence import TASK
from bilateral_rl.policies.lesions import INTACT
from bilateral_rl.study.trainings import Table, Training
from bilateral_rl.study.two_arms.readings import HandReading, spring_of
from bilateral_rl.vocabulary import Architecture

_NONE = Protocol("none")
_DEEP = ("deep_dominant", "deep_non_dominant")
STATES: dict[Architecture, tuple[str, ...]] = {
    "unilateral": (INTACT,),
    "bilateral": _DEEP,
    "callosal": ("callosum", *_DEEP),
}
"""The lesions that claims on two arms are about."""


def hand_tables(reading: HandReading, training: Training, profile: str) -> Iterator[Table]:
    """Yield the tables: of the claims' task with the spring and without, by each protocol; of others as they learned.

    The same networks are tested in the same trials with either spring.
    """
    config = training.config
    architecture, own = config.spec.architecture, spring_of(config)
    states = STATES[architecture]
    if config.task != TASK or architecture == "unilateral":
        yield Table(training, _NONE, profile, profile, states, own)
        return
    tied = reading.criteria(config).tied
    of_cut = [reading.callosum] if architecture == "callosal" else []
    for spring in dict.fromkeys((own, tied, 0.0)):
        for protocol in dict.fromkeys((_NONE, *of_cut, reading.deep)):
            yield Table(training, protocol, profile, profile, states, spring)
