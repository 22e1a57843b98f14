"""Tensorboard's files of a training that goes on from an earlier state: no step twice, all in their order."""

from __future__ import annotations

import os
from pathlib import Path

from google.protobuf.message import DecodeError  # type: ignore[import-untyped]
from tensorboard.compat.proto.event_pb2 import Event  # type: ignore[import-untyped]

_LENGTH, _CHECKSUM = 8, 4
"""Bytes. A record is its length, a checksum, its content, and another checksum."""
_LONGEST = 2**28
"""Bytes of a record, far beyond use: somebody else's file may claim anything."""


def cut_back(folder: Path, step: int) -> None:
    """Remove what ``folder`` says of later steps, and give its files names that come before that of any new one.

    Tensorboard reads files in the order of their names, which begin with the time by the clock on the wall: two of one
    second, or a clock that was set back, would mix them up, and its own ``purge_step`` then purges the wrong ones.
    """
    for number, path in enumerate(sorted(folder.glob("events.out.tfevents.*"))):
        os.truncate(path, _end(path, step))
        path.rename(folder / f"events.out.tfevents.{number:010d}")


def _end(path: Path, step: int) -> int:
    """Where the first record of a later step begins, or one that was not written to its end."""
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
