"""The runs that there are."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bilateral_rl.api.checks import as_path
from bilateral_rl.api.wording import in_python
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder, find_runs

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Listed:
    """A run in a list."""

    run: str
    """Its folder."""
    task: str | None = None
    model: str | None = None
    algo: str | None = None
    seeds: int | None = None
    """How many networks it has."""
    state: str = "unreadable"
    """As in :attr:`Run.status`; "?" if it has not begun, "unreadable" if it is damaged."""
    timesteps: int | None = None
    """Environment steps that the seed that came furthest has done."""
    epochs: int | None = None
    """Epochs of supervised training, likewise."""


@in_python
def list_runs(out: str | Path = "runs") -> pd.DataFrame:
    """Return the runs below a folder, oldest first within each task and model.

    Args:
        out: folder of all runs.

    Returns:
        A row a run, with columns ``run`` (what :func:`load` takes), ``task``, ``model``, ``algo``, ``seeds`` (how many
        networks), ``state`` ("running", "finished", "interrupted", "failed", "imported"; "?" if it has not begun,
        "unreadable" if it is damaged), and how far the seed that came furthest is: ``timesteps`` of reinforcement
        learning or ``epochs`` of supervised training.
    """
    import pandas as pd  # here alone: the command lists without it

    columns = [field.name for field in fields(Listed)]
    table = pd.DataFrame([asdict(one) for one in listed(as_path("--out", out))], columns=columns)
    return table.astype(dict.fromkeys(("seeds", "timesteps", "epochs"), "Int64"))


def listed(out: Path) -> list[Listed]:
    """Return the runs below ``out``; those that cannot be read are there too."""
    return [_listed(run) for run in find_runs(out)]


def _listed(run: RunFolder) -> Listed:
    try:
        config, status = run.config(), run.status()
    except UserError:
        return Listed(str(run.path))
    done: dict[str, Any] = {name: status.get(name) for name in ("timesteps", "epochs")}
    if done["epochs"] is not None:
        done["timesteps"] = None
    return Listed(str(run.path), config.task, config.model, config.algo, config.seeds, status.get("state", "?"), **done)
