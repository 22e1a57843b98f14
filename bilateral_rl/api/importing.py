"""Models that stable-baselines3 saved, as runs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bilateral_rl.api.checks import as_path, settings_by_name
from bilateral_rl.api.run import Run
from bilateral_rl.api.wording import in_python
from bilateral_rl.config.code_tasks import allow_code
from bilateral_rl.config.tasks import TaskWords
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs import sb3_import


@in_python
def import_model(
    model: str | Path,
    task: TaskWords,
    *,
    trust_pickle: bool = False,
    settings: Mapping[str, Any] | None = None,
    vec_normalize: str | Path | None = None,
    out: str | Path = "runs",
) -> Run:
    """Make a run of a model saved by stable-baselines3, so that all else can be done with it.

    Args:
        model: the zip file, with a policy of bilateral_rl.
        task: what it was trained for, "random_reach", "hold_position", an experiment or its
            file, or a class of yours as "module:Class".
        trust_pickle: to load it although that executes whatever its author wants.
        settings: what the file does not tell, such as ``{"trial.threshold": 0.03}``.
        vec_normalize: the file of statistics of a model that was trained on normalized observations, as SB3's
            ``VecNormalize.save`` writes it; they are folded into the network. Loading it executes code as well.
        out: folder of all runs.

    Raises:
        UserError: a file that is no such model, or that is not trusted; nothing is left then.
    """
    path = as_path("MODEL", model)
    if not path.is_file():
        raise UserError(f"There is no file {path}; `bilateral-rl import` takes a model saved by stable-baselines3.")
    if trust_pickle is not True:
        raise UserError(
            f"{path} holds pickles, and to load them is to execute whatever their author wants: add --trust-pickle if "
            "you trust where it comes from."
        )
    allow_code([task])
    statistics = None if vec_normalize is None else as_path("--vec-normalize", vec_normalize)
    by_name = settings_by_name("--set", settings)
    return Run(sb3_import.import_model(path, task, by_name, as_path("--out", out), statistics))
