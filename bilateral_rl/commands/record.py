"""`bilateral-rl record`."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import Progress

from bilateral_rl.analysis import recording_files
from bilateral_rl.analysis.recording import Recording
from bilateral_rl.analysis.recording_of_runs import Recorder
from bilateral_rl.commands.checks import check_trials
from bilateral_rl.config.parse import parse_overrides
from bilateral_rl.policies.lesions import INTACT
from bilateral_rl.runs.policies import parse_run


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
    check_trials(trials, seed)
    recording_files.check_path(out)
    folder, only = parse_run(run)
    recorder = Recorder.of_run(
        folder,
        only,
        trials=trials,
        seed=seed,
        lesions=lesions or [INTACT],
        task=task,
        settings=parse_overrides(overrides),
        weights=weights,
    )
    recording_files.write(out, _counted(recorder, console), recorder.total)
    for note in recorder.conditions.notes:
        console.print(f"[yellow]Note:[/yellow] {escape(note)}", soft_wrap=True, highlight=False)
    quoted = escape(shlex.quote(str(out)))
    console.print(f"Saved {recorder.total:,} trials in [bold]{quoted}[/bold].", soft_wrap=True, highlight=False)


def _counted(recorder: Recorder, console: Console) -> Iterator[Recording]:
    """Yield the parts of a recording, with a bar that counts trials where there is a terminal."""
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("recording", total=recorder.total)
        for part in recorder.parts():
            yield part
            bar.advance(task, len(part))
