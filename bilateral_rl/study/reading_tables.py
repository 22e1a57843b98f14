"""Which tables of results a reading asks for of a training."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.study.readings import Reading
from bilateral_rl.study.trainings import Table, Training
from bilateral_rl.study.two_arms.readings import HandReading
from bilateral_rl.study.two_arms.tables import hand_tables

AnyReading: TypeAlias = Reading | HandReading
"""A reading of either study."""
_NONE = Protocol("none")


def tables_of(reading: AnyReading, training: Training, profile: str) -> Iterator[Table]:
    """Yield the tables by which a reading judges the networks of a training.

    Args:
        reading: the reading.
        training: one of its trainings.
        profile: of the study.
    """
    if isinstance(reading, HandReading):
        yield from hand_tables(reading, training, profile)
        return
    architecture = training.config.spec.architecture
    # Combined lesions are of a callosum and one side.
    lesions = reading.lesion_profile(profile) if architecture == "callosal" else profile
    protocols = [_NONE] if architecture == "unilateral" else [_NONE, reading.protocol]
    for protocol in dict.fromkeys(protocols):
        yield Table(training, protocol, lesions, profile)
