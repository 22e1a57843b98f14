"""`bilateral-rl list`."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bilateral_rl.api.listing import Listed, listed
from bilateral_rl.config.catalogue import ALGORITHMS, MODELS
from bilateral_rl.envs.experiments.files import paradigms
from bilateral_rl.envs.task_specs import TASK_SPECS


def list_all(out: Path, console: Console) -> None:
    """Print the models, tasks and algorithms, and the runs below ``out``."""
    models = Table("model", "architecture", "trained by", "", title="Models", title_justify="left")
    for name, model in MODELS.items():
        models.add_row(name, model.architecture, model.loss, model.description)
    console.print(models)
    tasks = {name: spec.description for name, spec in TASK_SPECS.items()}
    for title, entries in (("Tasks", tasks), ("Experiments", paradigms()), ("Algorithms", ALGORITHMS)):
        table = Table("name", "", title=title, title_justify="left")
        for name, description in entries.items():
            table.add_row(name, description)
        console.print(table)
    runs = listed(out)
    if not runs:
        where = escape(str(out.absolute()))
        console.print(f"No runs below {where} yet; `bilateral-rl train` makes one.", soft_wrap=True)
        return
    table = Table("run", "state", "done", title="Runs", title_justify="left")
    for run in runs:
        table.add_row(escape(run.run), escape(run.state), _done(run))
    console.print(table)


def _done(run: Listed) -> str:
    """Say how far the seed that came furthest has come."""
    of_seeds = f" of {run.seeds} seeds" if (run.seeds or 1) > 1 else ""
    if run.epochs is not None:
        return f"{run.epochs} epochs{of_seeds}"
    return f"{run.timesteps:,} steps{of_seeds}" if run.timesteps else ""
