"""What stored results are of: the run, which of its weights, and their hash, so that stale results are noticed."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bilateral_rl.runs.folder import RunFolder

SOURCE = ("run", "weights", "weights_hash", "version")
"""Keys of a source. Results of version 0.1.0 have no hash and no version, and at most an absolute path."""


def describe_source(run: RunFolder, weights: str, folder: Path) -> dict[str, str]:
    """Describe what results that lie in ``folder`` are of.

    The path of the run is relative to ``folder``, so that both can be moved together.

    Raises:
        UserError: weights that are missing or damaged.
    """
    from bilateral_rl import __version__

    return {
        "run": _relative(run.path.resolve(), folder.resolve()),
        "weights": weights,
        "weights_hash": run.weights_hash(weights),
        "version": __version__,
    }


def source_file(results: Path) -> Path:
    """The file beside a table of results that says what they are of."""
    return results.with_suffix(".json")


def read_source(results: Path) -> dict[str, Any]:
    """What a table of results is of; an empty dictionary if it does not say it. Raises UserError if that is damaged."""
    path = source_file(results)
    source = RunFolder(path.parent).read_json(path.name, default={})
    return source if isinstance(source, dict) else {}


def is_stale(source: Mapping[str, Any], run: RunFolder) -> bool | None:
    """Whether results are of other weights than ``run`` has now; None if they do not say which weights they are of.

    Raises:
        UserError: weights that are damaged.
    """
    weights, stored_hash = source.get("weights"), source.get("weights_hash")
    if not isinstance(weights, str) or not isinstance(stored_hash, str):
        return None
    return weights not in run.weight_names() or run.weights_hash(weights) != stored_hash


def source_path(source: Mapping[str, Any], folder: Path) -> Path | None:
    """Where the run lies that results in ``folder`` are of, if they say it; the path may lead nowhere by now."""
    stored = source.get("run")
    if not isinstance(stored, str) or "\0" in stored:
        return None
    return Path(os.path.realpath(folder / stored))  # an absolute path, as version 0.1.0 wrote, stays what it is


def _relative(path: Path, folder: Path) -> str:
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # on another drive
        return str(path)
