"""`bilateral-rl import`."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from bilateral_rl.api.importing import import_model
from bilateral_rl.config.parse import parse_overrides


def import_zip(
    *,
    path: Path,
    task: str,
    trust_pickle: bool,
    overrides: Sequence[str],
    vec_normalize: Path | None,
    out: Path,
    console: Console,
) -> None:
    """Make a run of a model that stable-baselines3 saved.

    Args:
        path: the zip file.
        task: the task that the model was trained for.
        trust_pickle: whether to load it, although that executes whatever its author wants.
        overrides: settings that the file does not tell, as ``--set`` takes them.
        vec_normalize: statistics of observations that the model was trained on, to be folded into the network.
        out: folder of all runs.
        console: where to print.

    Raises:
        UserError: a file that is no such model, or that is not trusted.
    """
    settings = parse_overrides(overrides, "trial.threshold=0.03")
    imported = import_model(
        path, task, trust_pickle=trust_pickle, settings=settings, vec_normalize=vec_normalize, out=out
    )
    config, run = imported.config, escape(shlex.quote(str(imported.path)))
    console.print(
        f"Imported as {config.model}, trained by {config.algo}, into [bold]{run}[/bold]. Next:", soft_wrap=True
    )
    console.print(f"  bilateral-rl evaluate {run}", soft_wrap=True, highlight=False)
