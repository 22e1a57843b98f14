"""What each command does, and what it says."""

from __future__ import annotations

import json
import math
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from bilateral_rl import settings, training
from bilateral_rl.catalogue import ALGORITHMS, MODELS, TASK_DESCRIPTIONS
from bilateral_rl.config import TrainConfig, resolve
from bilateral_rl.errors import UserError
from bilateral_rl.evaluation import Evaluator, TrialRecord, summaries
from bilateral_rl.run_folder import RunFolder, find_runs, replacing

INTERRUPTED_EXIT = 130
SUMMARY_TRIALS, SUMMARY_SEED = 1024, 2_000_000
"""Of the table at the end of a training; `evaluate` defaults to the same, so that both print the same numbers."""


def train(
    algo: str | None,
    model: str | None,
    task: str | None,
    flags: Mapping[str, Any],
    config_file: Path | None,
    overrides: Sequence[str],
    out: Path,
    console: Console,
) -> None:
    """Train from scratch: tuned defaults < file < --set < flags."""
    layers = [settings.load_file(config_file)] if config_file else []
    layers += [settings.parse_overrides(overrides), _nested(flags)]
    config = resolve(algo, task, layers, model=model)
    training.check_device(config.device)
    _report_training(config, console, lambda progress: training.train(config, out, progress))


def resume(path: Path, given: Mapping[str, Any], console: Console) -> None:
    """Go on with a run."""
    allowed = ("timesteps", "device")
    for name, value in given.items():
        if value is not None and name not in allowed:
            flag = name.rpartition(".")[2].replace("_", "-")
            raise UserError(f"A resumed run keeps its settings: --resume takes --timesteps and --device, not --{flag}.")
    folder = RunFolder.open(path)
    values = folder.config().to_values() | {name: given[name] for name in allowed if given[name] is not None}
    config = resolve(None, None, [values])
    training.check_device(config.device)
    _report_training(config, console, lambda progress: training.resume(folder, config, progress))


def evaluate(
    path: Path,
    trials: int,
    seed: int,
    deterministic: bool,
    weights: str,
    csv: Path | None,
    json_file: Path | None,
    console: Console,
) -> None:
    """Test a run's policy and print, and perhaps write, its measures."""
    if trials < 1 or seed < 0:
        raise UserError(f"--trials must be at least 1 and --seed at least 0, got {trials} and {seed}.")
    folder = RunFolder.open(path)
    config = folder.config()
    policy = training.load_policy(folder, weights)
    record = Evaluator(config.task, config.trial, trials, seed).run(policy, deterministic)
    console.print(_measures_table(record, config, f"{path} ({weights}), {trials} trials of seed {seed}"))
    if csv is not None:
        _write(csv, record.table(config.trial.threshold).to_csv(index=False))
    if json_file is not None:
        table = {f"{radius:g}": values for radius, values in summaries(record, config.trial.threshold).items()}
        head = {"run": str(path), "weights": weights, "trials": trials, "seed": seed, "deterministic": deterministic}
        _write(json_file, json.dumps(_finite(head | {"by_threshold_m": table}), indent=2, allow_nan=False) + "\n")


def list_all(out: Path, console: Console) -> None:
    """Print what there is to choose from, and the runs."""
    models = Table("model", "architecture", "trained by", "", title="Models", title_justify="left")
    for name, model in MODELS.items():
        models.add_row(name, model.architecture, model.loss, model.description)
    console.print(models)
    for title, entries in (("Tasks", TASK_DESCRIPTIONS), ("Algorithms", ALGORITHMS)):
        table = Table("name", "", title=title, title_justify="left")
        for name, description in entries.items():
            table.add_row(name, description)
        console.print(table)
    runs = find_runs(out)
    if not runs:
        console.print(f"No runs below {out} yet; `bilateral-rl train` makes one.")
        return
    table = Table("run", "state", "steps", title="Runs", title_justify="left")
    for run in runs:
        try:
            status = run.status()
        except UserError:
            status = {"state": "damaged"}
        steps = status.get("timesteps", 0)
        table.add_row(escape(str(run.path)), escape(status.get("state", "?")), f"{steps:,}" if steps else "")
    console.print(table)


class TrainingProgress(training.Progress):
    """A bar with the remaining time and the present goal completion; lines where there is no terminal."""

    def __init__(self, total: int, console: Console) -> None:
        self._console = console
        self._draws = console.is_terminal and not console.is_dumb_terminal
        self._bar = Progress(
            TextColumn("[bold]training"),
            BarColumn(),
            TaskProgressColumn(),
            TimeRemainingColumn(),
            TextColumn("left"),
            TextColumn("{task.fields[goal]}"),
            TextColumn("{task.fields[speed]}"),
            console=console,
            disable=not self._draws,
        )
        self._task = self._bar.add_task("train", total=total, start=False, speed="", goal="")

    def __enter__(self) -> TrainingProgress:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def on_start(self, timesteps: int) -> None:
        self._bar.reset(self._task, completed=timesteps)

    def on_step(self, timesteps: int) -> None:
        speed = self._bar.tasks[self._task].speed
        text = f"{speed / 1000:.0f} k steps/s" if speed else ""
        self._bar.update(self._task, completed=timesteps, speed=text)

    def on_evaluation(self, timesteps: int, measures: dict[str, float]) -> None:
        goal = f"goal {measures['goal_completion_percent']:.0f} %"
        inside = f"{measures['time_in_goal_steps']:.0f} steps in goal"
        self._bar.update(self._task, goal=goal)
        if not self._draws:
            error = f"final error {measures['final_error_cm']:.1f} cm"
            self._console.print(f"{timesteps:>12,} steps: {goal}, {inside}, {error}", highlight=False)


def _report_training(config: TrainConfig, console: Console, run: Any) -> None:
    console.print(
        f"[bold]{config.model}[/bold] learns [bold]{config.task}[/bold] by {config.algo}: "
        f"{config.timesteps:,} steps of {config.n_envs} arms, seed {config.seed}. Ctrl-C stops and saves."
    )
    with TrainingProgress(config.timesteps, console) as progress:
        outcome: training.Outcome = run(progress)
    path = escape(shlex.quote(str(outcome.folder.path)))
    out = escape(shlex.quote(str(outcome.folder.path.parent.parent)))
    minutes = f"{outcome.seconds / 60:.1f} minutes"
    if outcome.interrupted:
        console.print(f"Stopped after {outcome.timesteps:,} steps and {minutes}; saved in [bold]{path}[/bold].")
        console.print(f"Go on with: bilateral-rl train --resume {path}", soft_wrap=True)
        sys.exit(INTERRUPTED_EXIT)
    evaluator = Evaluator(config.task, config.trial, SUMMARY_TRIALS, SUMMARY_SEED, config.device)
    record = evaluator.run(outcome.policy)
    title = f"What {config.model} learned in {minutes}, {SUMMARY_TRIALS} new trials"
    console.print(_measures_table(record, config, title))
    console.print(f"Saved in [bold]{path}[/bold]. Next:", soft_wrap=True)
    console.print(f"  bilateral-rl evaluate {path}", soft_wrap=True, highlight=False)
    console.print(f"  tensorboard --logdir {out}", soft_wrap=True, highlight=False)
    other = "hold_position" if config.task == "random_reach" else "random_reach"
    command = f"bilateral-rl train --model {config.model} --task {other} --out {out}"
    console.print(f"  {command}", soft_wrap=True, highlight=False)


def _measures_table(record: TrialRecord, config: TrainConfig, title: str) -> Table:
    table = Table("goal radius", title=escape(title), title_justify="left")
    for column in ("goal completion", "speed to goal", "time in goal"):
        table.add_column(column, justify="right")
    rows = summaries(record, config.trial.threshold)
    for radius, row in rows.items():
        speed = row["speed_to_goal_cm_per_step"]
        own = "[bold]" if math.isclose(radius, config.trial.threshold) else ""
        table.add_row(
            f"{own}{100 * radius:g} cm",
            f"{own}{row['goal_completion_percent']:.1f} %",
            f"{own}{speed:.2f} cm/step" if speed > 0 else "–",  # nan: never reached; 0: a hold starts there
            f"{own}{row['time_in_goal_steps']:.1f} of {config.trial.trial_length} steps",
        )
    any_row = rows[config.trial.threshold]
    table.caption = (
        f"final error {any_row['final_error_cm']:.1f} cm; return: dominant {any_row['return_dominant']:.1f}, "
        f"non-dominant {any_row['return_non_dominant']:.1f}"
    )
    return table


def _nested(flags: Mapping[str, Any]) -> dict[str, Any]:
    nested: dict[str, Any] = {}
    for name, value in flags.items():
        if value is None:
            continue
        for part in reversed(name.split(".")):
            value = {part: value}
        nested = settings.merge(nested, value)
    return nested


def _write(path: Path, text: str) -> None:
    if str(path) == "-":
        sys.stdout.write(text)
        return
    try:
        path = path.resolve()
        if path.exists() and not path.is_file():
            path.write_text(text, encoding="utf-8")  # a device or a pipe: nothing to replace
            return
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UserError(f"Cannot write {path}: {error.strerror}.") from None


def _finite(value: Any) -> Any:
    """``value`` with None for numbers that JSON cannot hold."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
