"""`bilateral-rl export`."""

from __future__ import annotations

import shlex
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from bilateral_rl.api import exporting
from bilateral_rl.api.run import find_run
from bilateral_rl.config.code_tasks import confirm_code
from bilateral_rl.runs.export import CARD


def export(*, run: str, out: Path, trials: int, seed: int, weights: str, task: str | None, console: Console) -> None:
    """Write a run as a folder to publish, with a model card that says what it does in new trials.

    Args:
        run: RUN, or RUN:SEED for one network of it.
        out: the folder, which must be free.
        trials: number of trials of each network.
        seed: seed of the first trial.
        weights: which of the run's weights.
        task: the class that the runs learned, whose code may be run; None for nothing.
        console: where to print.

    Raises:
        UserError: what cannot be tested or written; nothing is left then.
    """
    chosen = find_run(run)
    confirm_code(chosen.config.task, task, run)
    made = exporting.export(chosen, out, trials=trials, seed=seed, weights=weights)
    folder = escape(shlex.quote(str(made.path)))
    console.print(f"Exported to [bold]{folder}[/bold]; its {CARD} is the model card.", soft_wrap=True)
    console.print(f"  bilateral-rl evaluate {folder}", soft_wrap=True, highlight=False)
