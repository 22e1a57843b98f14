"""The weight penalty of a study in its report, beside the one by which `train` trains if nothing is said."""

from __future__ import annotations

from collections.abc import Sequence

from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.figures.labels import task_label
from bilateral_rl.study.report_table import ReportTable

_NOTE = "λ of the L2 penalty, which is part of the non-dominant loss alone: Uni-DL pays none."


def penalty_table(configs: Sequence[TrainConfig]) -> ReportTable:
    """Make the table of λ in the trainings of a study and by default in `train`, a row a task."""
    rows = [[task_label(task), f"{own:g}", f"{default:g}"] for task, (own, default) in _by_task(configs).items()]
    return ReportTable("penalty", "The weight penalty", ["", "this study", "train"], rows, penalty_in_words(configs))


def penalty_in_words(configs: Sequence[TrainConfig]) -> str:
    """Say by which λ a study's networks were trained, and by which one `train` trains."""
    by_task = _by_task(configs)
    own = {task: own for task, (own, _) in by_task.items()}
    default = {task: default for task, (_, default) in by_task.items()}
    if own == default:
        return f"{_NOTE} This study has {_words(own)}, as train has by default."
    return f"{_NOTE} This study has {_words(own)}; train has {_words(default)} by default, tuned for what CC-S learns."


def _by_task(configs: Sequence[TrainConfig]) -> dict[str, tuple[float, float]]:
    """λ of a study's trainings and of `train`, by task."""
    return {c.task: (c.penalty_coefficient, resolve(c.algo, c.task).penalty_coefficient) for c in configs}


def _words(penalties: dict[str, float]) -> str:
    """λ of each task; once if it is the same in all."""
    if len(set(penalties.values())) == 1:
        return f"λ = {next(iter(penalties.values())):g}"
    return " and ".join(f"λ = {penalty:g} in {task_label(task).lower()}" for task, penalty in penalties.items())
