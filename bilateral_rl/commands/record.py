"""`bilateral-rl record`."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from bilateral_rl.api.recording import record_to
from bilateral_rl.api.run import find_run
from bilateral_rl.config.parse import parse_overrides


def record(
    *,
    run: str,
    out: Path,
    trials: int,
    seed: int,
    lesions: Sequence[str],
    task: str | None,
    overrides: Sequence[str],
    weights: str,
    console: Console,
) -> None:
    """Write a file with everything that moved in trials of a run's networks.

    Args:
        run: RUN, or RUN:SEED for one network of it.
        out: a .csv, .npz, .parquet or .nc file; an earlier one is replaced.
        trials: number of trials of each network with each lesion.
        seed: seed of the first trial.
        lesions: names of lesions; none for intact networks.
        task: another task than the run's.
        overrides: other settings of trials, ``["trial.sensory_noise=0.01"]``.
        weights: which of the run's weights.
        console: where to print.

    Raises:
        UserError: a run that cannot be recorded so, or a file that cannot be written; none is left then.
    """
    settings = parse_overrides(overrides, "trial.sensory_noise=0.01")
    recorder = record_to(out, find_run(run), trials, seed, lesions, task, settings, weights, console)
    for note in recorder.conditions.notes:
        console.print(f"[yellow]Note:[/yellow] {escape(note)}", soft_wrap=True, highlight=False)
    quoted = escape(shlex.quote(str(out)))
    how_many = f"{recorder.total:,} trial{'s' * (recorder.total != 1)}"
    console.print(f"Saved {how_many} in [bold]{quoted}[/bold].", soft_wrap=True, highlight=False)
