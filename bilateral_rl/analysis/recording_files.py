"""Recordings as files: CSV, NPZ, Parquet and NetCDF, written part by part, whole or not at all."""

from __future__ import annotations

import contextlib
import importlib
import itertools
import json
import os
import shutil
import tempfile
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.analysis.recording_fields import LABEL_NAMES, LABELS, STEP, TIME, TRIAL
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import replacing

if TYPE_CHECKING:
    from bilateral_rl.analysis.recording import Recording

_LIBRARIES = {".parquet": "pyarrow", ".nc": "netCDF4"}
"""What writes the formats for which NumPy and pandas do not do; both are in the extra ``record``."""


def check_path(path: Path) -> None:
    """Refuse a file that a recording cannot be written into.

    Raises:
        UserError: an unknown ending, a library that is missing, or something at ``path`` that is no file.
    """
    ending = path.suffix.lower()
    if ending not in WRITERS:
        raise UserError(f"A recording's name ends in {', '.join(WRITERS)}, got {path}: choose one of these.")
    library = _LIBRARIES.get(ending)
    if library is not None:
        try:
            importlib.import_module(library)
        except ImportError:
            raise UserError(
                f"{ending} files take the library {library}, which is not installed: install the extra, "
                '`pip install -c constraints.txt -e ".[record]"`, or choose .csv or .npz.'
            ) from None
    for one in (path, side_file(path)) if ending == ".csv" else (path,):
        try:
            if one.exists() and not one.is_file():
                raise UserError(f"{one} is not a regular file: choose another name.")
        except OSError as error:
            raise UserError(f"Cannot write {one}: {error.strerror}.") from None


def write(path: Path, parts: Iterable[Recording], n: int) -> None:
    """Write parts of a recording, one after another, into one file; an earlier file is replaced.

    Args:
        path: the file; its ending says how.
        parts: recordings of the same kind, of ``n`` trials in all; a file holds the metadata of the first.
        n: number of trials.

    Raises:
        UserError: as :func:`check_path`, or the file cannot be written; none is left then, and an earlier one stays.
    """
    check_path(path)
    try:
        WRITERS[path.suffix.lower()](path.resolve(), parts, n)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise UserError(f"Cannot write {path}: {reason}.") from None


def side_file(path: Path) -> Path:
    """Return the JSON file beside a CSV file, which has no place to say where its numbers come from."""
    return path.with_name(f"{path.name}.json")


def description(part: Recording) -> dict[str, Any]:
    """Return what a file says of a recording: its metadata, the length of a step, its fields, and names in them."""
    fields = {
        field.name: {"unit": field.unit, "dimensions": [TRIAL, *field.dims], "description": field.description}
        for field in part.fields
    }
    dims = {dim for field in part.fields for dim in field.dims}
    names = {dim: list(labels) for dim, labels in LABELS.items() if dim in dims}
    return {**part.metadata, "timestep_s": part.timestep, "fields": fields, "names": names}


def _write_csv(path: Path, parts: Iterable[Recording], n: int) -> None:
    """Write a row for each trial and moment with seven digits, which is all that float32 has; nothing stands for NaN.

    By Python's own formatting, which takes a third of the time of pandas'.
    """
    first, parts = _first_of(parts)
    with replacing(path) as temporary, replacing(side_file(path)) as beside:
        beside.write_text(json.dumps(description(first), indent=2) + "\n", encoding="utf-8")
        with temporary.open("w", encoding="utf-8", newline="") as file:
            file.write(",".join([*first.label_columns(), "step", "time_s", *first.columns()]) + "\n")
            clock = [f"{step},{time:.7g}," for step, time in enumerate(first.time)]
            for part in parts:
                labels = zip(*(values.tolist() for values in part.label_columns().values()), strict=True)
                for head, rows in zip(labels, part.rows(), strict=True):
                    file.write(_csv_lines(",".join(map(str, head)), clock, rows))


def _csv_lines(head: str, clock: Sequence[str], rows: NDArray[np.float32]) -> str:
    """Return the lines of one trial (T + 1, columns): all rows but the last have numbers in the same columns."""
    texts = [text for some in (rows[:-1], rows[-1:]) for text in _csv_texts(some)]
    return "".join(f"{head},{moment}{text}\n" for moment, text in zip(clock, texts, strict=True))


def _csv_texts(rows: NDArray[np.float32]) -> list[str]:
    """Return the texts of rows that have numbers in the same columns, and nothing in the others."""
    there = ~np.isnan(rows[0])
    pattern = ",".join("%.7g" if number else "" for number in there)
    return [pattern % tuple(row) for row in rows[:, there].tolist()]


def _write_npz(path: Path, parts: Iterable[Recording], n: int) -> None:
    """Write an array for each field, the moments in ``time`` (s), and ``metadata``: JSON, as a text."""
    first, parts = _first_of(parts)
    with replacing(path) as temporary, contextlib.ExitStack() as stack:
        # A zip holds one array after another, but parts come with a piece of each.
        pieces = {
            name: stack.enter_context(tempfile.TemporaryFile(dir=path.parent))
            for name in (f.name for f in first.fields)
        }
        for part in parts:
            for name, file in pieces.items():
                file.write(np.ascontiguousarray(part[name]).data)
        with zipfile.ZipFile(temporary, "w") as archive:
            _add_array(archive, "metadata", np.array(json.dumps(description(first))))
            _add_array(archive, "time", first.time)
            for name, file in pieces.items():
                file.seek(0)
                _add_array(archive, name, np.empty((n, *first[name].shape[1:]), first[name].dtype), file)


def _add_array(archive: zipfile.ZipFile, name: str, array: NDArray[Any], content: BinaryIO | None = None) -> None:
    """Add an array to an .npz file; with ``content``, an array like ``array`` whose bytes are there."""
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        header = np.lib.format.header_data_from_array_1_0(array)
        np.lib.format.write_array_header_1_0(member, header)
        if content is None:
            member.write(array.tobytes())
        else:
            shutil.copyfileobj(content, member, 2**20)


def _write_parquet(path: Path, parts: Iterable[Recording], n: int) -> None:
    """Write the table of :meth:`Recording.frame`; units and descriptions are the columns' metadata."""
    import pyarrow as pa  # an extra
    from pyarrow import parquet

    first, parts = _first_of(parts)
    columns = {name: field for field in first.fields for name in field.columns(first[field.name].shape)}
    schema = pa.Table.from_pandas(first.frame(), preserve_index=False).schema
    for i, column in enumerate(schema):
        if field := columns.get(column.name):
            schema = schema.set(i, column.with_metadata({"unit": field.unit, "description": field.description}))
    schema = schema.with_metadata({**schema.metadata, "bilateral_rl": json.dumps(description(first))})
    with replacing(path) as temporary, parquet.ParquetWriter(temporary, schema) as writer:
        for part in parts:
            writer.write_table(pa.Table.from_pandas(part.frame(), schema, preserve_index=False))


def _write_netcdf(path: Path, parts: Iterable[Recording], n: int) -> None:
    """Write a variable for each field with its unit and description, and coordinates; the metadata are attributes."""
    import netCDF4  # an extra

    first, parts = _first_of(parts)
    with replacing(path) as temporary:
        try:
            with netCDF4.Dataset(temporary, "w") as file:
                _begin_netcdf(file, first, n)
                done = 0
                for part in parts:
                    for field in part.fields:
                        file[field.name][done : done + len(part)] = _for_netcdf(part[field.name])
                    done += len(part)
        except RuntimeError as error:  # what netCDF4 makes of a full disk, without saying so
            raise OSError(f"the disk may be full ({error})") from None


def _begin_netcdf(file: Any, first: Recording, n: int) -> None:
    sizes = {TRIAL: n}
    for field in first.fields:
        sizes |= dict(zip(field.dims, first[field.name].shape[1:], strict=True))
    for dim, size in sizes.items():
        file.createDimension(dim, size)
    coordinates = {TIME: first.time, STEP: np.arange(sizes[STEP])}
    for dim in sizes.keys() - {TRIAL, TIME, STEP}:
        coordinates[dim] = np.array(LABELS[dim] if dim in LABELS else np.arange(1, sizes[dim] + 1))
    for name, values in coordinates.items():
        file.createVariable(name, _netcdf_type(values), (name,))[:] = _for_netcdf(values)
    file[TIME].units = "s"
    for field in first.fields:
        variable = file.createVariable(field.name, _netcdf_type(first[field.name]), (TRIAL, *field.dims))
        variable.long_name = field.description
        if field.name not in LABEL_NAMES:
            variable.units = field.unit or "1"
    for name, value in first.metadata.items():
        file.setncattr(name, value if isinstance(value, (str, int, float)) else json.dumps(value))
    file.timestep_s = first.timestep


def _netcdf_type(values: NDArray[Any]) -> Any:
    return str if values.dtype.kind == "U" else values.dtype


def _for_netcdf(values: NDArray[Any]) -> NDArray[Any]:
    """Return the values as netCDF4 takes them: texts as objects."""
    return values.astype(object) if values.dtype.kind == "U" else values


def _first_of(parts: Iterable[Recording]) -> tuple[Recording, Iterator[Recording]]:
    """Return the first of the parts, and all of them."""
    iterator = iter(parts)
    first = next(iterator)
    return first, itertools.chain([first], iterator)


WRITERS: dict[str, Callable[[Path, Iterable[Recording], int], None]] = {
    ".csv": _write_csv,
    ".npz": _write_npz,
    ".parquet": _write_parquet,
    ".nc": _write_netcdf,
}
"""What writes a recording, by the file's ending."""
