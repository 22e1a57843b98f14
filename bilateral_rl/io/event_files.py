"""Tensorboard's event files, cut back where a training goes on from an earlier state."""

from __future__ import annotations

import os
from pathlib import Path

from google.protobuf.message import DecodeError  # type: ignore[import-untyped]
from tensorboard.compat.proto.event_pb2 import Event  # type: ignore[import-untyped]

_LENGTH, _CHECKSUM = 8, 4
"""Sizes in bytes: a record is its length, a checksum, its content, and another checksum."""
_LONGEST = 2**28
"""Longest record that is read, in bytes: a damaged file may claim any length."""


def cut_back(folder: Path, step: int) -> None:
    """Remove records of later steps from the event files in ``folder``, and rename the files to come before new ones.

    Tensorboard reads files in the order of their names, which hold the time at which each was made. Two files of one
    second, or a clock that was set back, would mix them up, and tensorboard's own ``purge_step`` would then purge the
    wrong records.
    """
    for number, path in enumerate(sorted(folder.glob("events.out.tfevents.*"))):
        os.truncate(path, _end_of_past(path, step))
        path.rename(folder / f"events.out.tfevents.{number:010d}")


def _end_of_past(path: Path, step: int) -> int:
    """Find where the first record begins that is of a later step or was not written to its end, in bytes."""
    end = 0
    with path.open("rb") as file:
        while len(head := file.read(_LENGTH + _CHECKSUM)) == _LENGTH + _CHECKSUM:
            length = int.from_bytes(head[:_LENGTH], "little")
            if not 0 < length <= _LONGEST:
                break
            rest = file.read(length + _CHECKSUM)
            if len(rest) < length + _CHECKSUM or not _is_of_past(rest[:length], step):
                break
            end = file.tell()
    return end


def _is_of_past(record: bytes, step: int) -> bool:
    try:
        return bool(Event.FromString(record).step <= step)
    except DecodeError:
        return False
