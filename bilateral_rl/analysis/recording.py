"""Recordings: trials of trained networks with everything that moved in them, as arrays, tables and files."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bilateral_rl.analysis import recording_files
from bilateral_rl.analysis.recording_arms import has_arms, of_arm, of_one_arm
from bilateral_rl.analysis.recording_fields import LABEL_NAMES, STEP, TIME, Field
from bilateral_rl.io.errors import UserError
from bilateral_rl.vocabulary import SIDES

Float32 = NDArray[np.float32]


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """``n`` trials, of one network or of several, one after another.

    ``recording["hand"]`` is an array (n, T + 1, 2): its dimensions are a trial, then those of its field. Of two arms it
    is (n, T + 1, 2 arms, 2), the dominant arm first, in the frame of the body (:meth:`of_hand`). States are
    recorded at the start and after each of the T steps. What belongs to a step (observation, hidden activity,
    excitation, reward) stands at the step's number, from 0: step k begins at moment k and ends at moment k + 1.
    """

    fields: tuple[Field, ...]
    """What is recorded, with unit, dimensions and description."""
    arrays: Mapping[str, NDArray[Any]]
    """The values by the name of their field, in float32; which network, lesion and trial each row is of, as labels."""
    timestep: float
    """Length of a step (s)."""
    metadata: Mapping[str, Any]
    """Where the trials come from: run, task, settings, versions and more, ready for JSON."""

    def __repr__(self) -> str:
        names = ", ".join(field.name for field in self.quantities)
        return f"<Recording of {len(self):,} trials of {len(self.time) - 1} steps: {names}>"

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.arrays[name]

    def __len__(self) -> int:
        """Number of trials, over all networks and lesions."""
        return len(self.arrays["trial"])

    @property
    def time(self) -> NDArray[np.float64]:
        """(T + 1,): the moments at which states are recorded (s)."""
        return np.arange(self.arrays["hand"].shape[1], dtype=np.float64) * self.timestep

    @property
    def labels(self) -> tuple[Field, ...]:
        """The fields that say which trial of which network this is."""
        return tuple(field for field in self.fields if field.name in LABEL_NAMES)

    @property
    def quantities(self) -> tuple[Field, ...]:
        """The fields that are numbers of the trials, without the labels."""
        return tuple(field for field in self.fields if field.name not in LABEL_NAMES)

    @property
    def n_arms(self) -> int:
        """How many arms a trial has."""
        return len(SIDES) if any(map(has_arms, self.fields)) else 1

    def of_hand(self, hand: str, role: str | None = None) -> Recording:
        """Return what is recorded of one of two hands, as a recording of one arm, with every tool for such.

        It is in the frame of the hand's own arm, with the shoulder at the origin and x away from the midline, in which
        the same movements of both hands are the same numbers.

        Args:
            hand: "dominant" or "non_dominant".
            role: "reach" or "hold", for the trials alone in which that is what the hand is to do; None for all.

        Raises:
            UserError: a recording of one arm, another hand or role, or one that the hand has in no trial.
        """
        if self.n_arms == 1:
            raise UserError("of_hand is for recordings of two arms, and this one is of one: use it as it is.")
        if hand not in SIDES:
            raise UserError(f"There is no {hand!r} hand; choose from {', '.join(SIDES)}.")
        arm = SIDES.index(hand)
        roles = self.arrays["role"][:, arm]
        rows = np.ones(len(self), dtype=np.bool_) if role is None else roles == role
        if not rows.any():
            raise UserError(f"The {hand} hand has no role {role!r} here; choose from {', '.join(np.unique(roles))}.")
        distance = self.metadata["settings"]["two_arms"]["shoulder_distance"]
        arrays = {
            field.name: of_arm(self.arrays[field.name][rows], field, arm, distance)
            if has_arms(field)
            else self.arrays[field.name][rows]
            for field in self.fields
        }
        fields = tuple(of_one_arm(field) if has_arms(field) else field for field in self.fields)
        return dataclasses.replace(self, fields=fields, arrays=arrays, metadata={**self.metadata, "hand": hand})

    def frame(self) -> pd.DataFrame:
        """Return a table with a row for each trial and moment, T + 1 a trial.

        The row of moment k has the states at it and what belongs to the step that begins then, which in the last row of
        a trial is NaN. Columns carry their unit, such as ``hand_x_m``.
        """
        moments, n = len(self.time), len(self)
        labels = {name: np.repeat(values, moments) for name, values in self.label_columns().items()}
        clock = {"step": np.tile(np.arange(moments), n), "time_s": np.tile(self.time, n)}
        numbers = pd.DataFrame(self.rows().reshape(n * moments, -1), columns=self.columns())
        return pd.concat([pd.DataFrame(labels | clock), numbers], axis=1)

    def label_columns(self) -> dict[str, NDArray[Any]]:
        """Return the labels of each trial, (n,) each, by the names of their columns."""
        columns: dict[str, NDArray[Any]] = {}
        for field in self.labels:
            values = self.arrays[field.name]
            columns |= dict(zip(field.columns(values.shape), values.reshape(len(self), -1).T, strict=True))
        return columns

    def columns(self) -> list[str]:
        """Return the names of the columns of :meth:`rows`."""
        return [name for field in self.quantities for name in field.columns(self.arrays[field.name].shape)]

    def rows(self) -> Float32:
        """Return all quantities side by side, (n, T + 1, columns); NaN in the last moment of what belongs to steps."""
        moments = len(self.time)
        blocks = []
        for field in self.quantities:
            values = self.arrays[field.name]
            if STEP in field.dims:
                values = values.reshape(len(self), moments - 1, -1)
                values = np.concatenate([values, np.full_like(values[:, :1], np.nan)], axis=1)
            elif TIME not in field.dims:
                values = np.repeat(values[:, None], moments, axis=1)
            blocks.append(values.reshape(len(self), moments, -1))
        return np.concatenate(blocks, axis=2)

    def save(self, path: str | Path) -> None:
        """Write a file, whole or not at all: CSV, NPZ, Parquet or NetCDF, as its name ends (.csv, .npz, .parquet, .nc).

        Raises:
            UserError: another ending, a file that cannot be written, or a library that is missing.
        """
        recording_files.write(Path(path), [self], len(self))

    @classmethod
    def join(cls, parts: Iterable[Recording]) -> Recording:
        """Return recordings of the same kind as one, one after another; the metadata are those of the first."""
        parts = list(parts)
        first = parts[0]
        arrays = {name: np.concatenate([part.arrays[name] for part in parts]) for name in first.arrays}
        return cls(first.fields, arrays, first.timestep, first.metadata)
