"""`bilateral-rl import`."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from bilateral_rl.config import parse as settings
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.sb3_import import import_model


def import_zip(
    *, path: Path, task: str, trust_pickle: bool, overrides: Sequence[str], out: Path, console: Console
) -> None:
    """Make a run of a model that stable-baselines3 saved.

    Args:
        path: the zip file.
        task: the task that the model was trained for.
        trust_pickle: whether to load it, although that executes whatever its author wants.
        overrides: settings that the file does not tell, as ``--set`` takes them.
        out: folder of all runs.
        console: where to print.

    Raises:
        UserError: a file that is no such model, or that is not trusted.
    """
    if not path.is_file():
        raise UserError(f"There is no file {path}; `import` takes a model saved by stable-baselines3.")
    if not trust_pickle:
        raise UserError(
            f"{path} holds pickles, and to load them is to execute whatever their author wants: add --trust-pickle if "
            "you trust where it comes from."
        )
    folder = import_model(path, task, settings.parse_overrides(overrides), out)
    config, run = folder.config(), escape(shlex.quote(str(folder.path)))
    console.print(
        f"Imported as {config.model}, trained by {config.algo}, into [bold]{run}[/bold]. Next:", soft_wrap=True
    )
    console.print(f"  bilateral-rl evaluate {run}", soft_wrap=True, highlight=False)
