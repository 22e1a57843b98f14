"""`bilateral-rl list`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bilateral_rl.config.catalogue import ALGORITHMS, MODELS
from bilateral_rl.envs.task_specs import TASK_SPECS
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import find_runs


def list_all(out: Path, console: Console) -> None:
    """Print the models, tasks and algorithms, and the runs below ``out``."""
    models = Table("model", "architecture", "trained by", "", title="Models", title_justify="left")
    for name, model in MODELS.items():
        models.add_row(name, model.architecture, model.loss, model.description)
    console.print(models)
    tasks = {name: spec.description for name, spec in TASK_SPECS.items()}
    for title, entries in (("Tasks", tasks), ("Algorithms", ALGORITHMS)):
        table = Table("name", "", title=title, title_justify="left")
        for name, description in entries.items():
            table.add_row(name, description)
        console.print(table)
    runs = find_runs(out)
    if not runs:
        console.print(f"No runs below {out} yet; `bilateral-rl train` makes one.")
        return
    table = Table("run", "state", "done", title="Runs", title_justify="left")
    for run in runs:
        try:
            run.config()
            status = run.status()
        except UserError:
            status = {"state": "unreadable"}
        table.add_row(escape(str(run.path)), escape(status.get("state", "?")), _done(status))
    console.print(table)


def _done(status: Mapping[str, Any]) -> str:
    """Say how far the seed that came furthest has come."""
    n_seeds = len(status.get("seeds", []))
    of_seeds = f" of {n_seeds} seeds" if n_seeds > 1 else ""
    if "epochs" in status:
        return f"{status['epochs']} epochs{of_seeds}"
    return f"{status['timesteps']:,} steps{of_seeds}" if status.get("timesteps") else ""
