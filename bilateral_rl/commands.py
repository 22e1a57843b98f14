"""What each command does, and what it says."""

from __future__ import annotations

import json
import math
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bilateral_rl import settings, training
from bilateral_rl.catalogue import ALGORITHMS, MODELS, TASK_DESCRIPTIONS
from bilateral_rl.config import BPTTConfig, TrainConfig
from bilateral_rl.controllers import initial_states, load_policies, parse_run
from bilateral_rl.errors import UserError
from bilateral_rl.evaluation import Evaluator, TrialRecord, summaries
from bilateral_rl.progress import Outcome, Progress, check_device
from bilateral_rl.reports import TrainingProgress, measures_table, training_title
from bilateral_rl.resolve import resolve
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
    check_device(config.device)
    initial_states(config)  # refused before anything is announced
    _report_training(config, console, lambda progress: training.train(config, out, progress))


def resume(path: Path, given: Mapping[str, Any], console: Console) -> None:
    """Go on with a run."""
    _refuse_but(("timesteps", "epochs", "device"), given)
    folder = RunFolder.open(path)
    config = folder.config()
    allowed = ("epochs" if isinstance(config, BPTTConfig) else "timesteps", "device")
    _refuse_but(allowed, given)
    values = config.to_values() | {name: given[name] for name in allowed if given[name] is not None}
    config = resolve(None, None, [values])
    check_device(config.device)
    _report_training(config, console, lambda progress: training.resume(folder, config, progress))


def _refuse_but(allowed: Sequence[str], given: Mapping[str, Any]) -> None:
    for name, value in given.items():
        if value is not None and name not in allowed:
            flag = name.rpartition(".")[2].replace("_", "-")
            flags = " and ".join(f"--{one}" for one in allowed)
            raise UserError(f"A resumed run keeps its settings: --resume takes {flags} here, not --{flag}.")


def evaluate(
    run: str,
    trials: int,
    seed: int,
    deterministic: bool,
    weights: str,
    csv: Path | None,
    json_file: Path | None,
    console: Console,
) -> None:
    """Test a run's policies, or one of them, and print, and perhaps write, their measures."""
    if trials < 1 or seed < 0:
        raise UserError(f"--trials must be at least 1 and --seed at least 0, got {trials} and {seed}.")
    folder, only = parse_run(run)
    config = folder.config()
    evaluator = Evaluator(config.task, config.trial, trials, seed)
    policies = load_policies(folder, weights, only)
    records = {own: evaluator.run(policy, deterministic) for own, policy in policies.items()}
    console.print(measures_table(records, config, f"{run} ({weights}), {trials} trials of seed {seed}"))
    threshold = config.trial.threshold
    if csv is not None:
        tables = [record.table(threshold).assign(seed=own) for own, record in records.items()]
        _write(csv, pd.concat(tables).to_csv(index=False))
    if json_file is not None:
        head = {"run": run, "weights": weights, "trials": trials, "seed": seed, "deterministic": deterministic}
        by_seed = {own: _by_threshold(record, threshold) for own, record in records.items()}
        measures = {"by_threshold_m": _means(list(by_seed.values())), "by_seed": by_seed}
        _write(json_file, json.dumps(_finite(head | measures), indent=2, allow_nan=False) + "\n")


def _by_threshold(record: TrialRecord, threshold: float) -> dict[str, dict[str, float]]:
    return {f"{radius:g}": values for radius, values in summaries(record, threshold).items()}


def _means(tables: Sequence[dict[str, dict[str, float]]]) -> dict[str, dict[str, float]]:
    """Means over the seeds, of what is a number in any."""
    return {
        radius: {name: float(pd.Series([table[radius][name] for table in tables]).mean()) for name in values}
        for radius, values in tables[0].items()
    }


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
    table = Table("run", "state", "done", title="Runs", title_justify="left")
    for run in runs:
        try:
            status = run.status()
        except UserError:
            status = {"state": "damaged"}
        table.add_row(escape(str(run.path)), escape(status.get("state", "?")), _done(status))
    console.print(table)


def _done(status: Mapping[str, Any]) -> str:
    if "epochs" in status:
        seeds = len(status.get("seeds", []))
        return f"{status['epochs']} epochs" + (f" of {seeds} seeds" if seeds > 1 else "")
    return f"{status['timesteps']:,} steps" if status.get("timesteps") else ""


def _report_training(config: TrainConfig, console: Console, run: Callable[[Progress], Outcome]) -> None:
    console.print(training_title(config))
    with TrainingProgress(config, console) as progress:
        outcome = run(progress)
    for note in outcome.notes:
        console.print(f"[yellow]Note:[/yellow] {escape(note)}", soft_wrap=True, highlight=False)
    path = escape(shlex.quote(str(outcome.folder.path)))
    out = escape(shlex.quote(str(outcome.folder.path.parent.parent)))
    minutes = f"{outcome.seconds / 60:.1f} minutes"
    if outcome.interrupted:
        unit = "updates" if isinstance(config, BPTTConfig) else "steps"
        console.print(f"Stopped after {outcome.done:,} {unit} and {minutes}; saved in [bold]{path}[/bold].")
        console.print(f"Go on with: bilateral-rl train --resume {path}", soft_wrap=True)
        sys.exit(INTERRUPTED_EXIT)
    evaluator = Evaluator(config.task, config.trial, SUMMARY_TRIALS, SUMMARY_SEED, config.device)
    records = {seed: evaluator.run(policy) for seed, policy in outcome.policies.items()}
    console.print(
        measures_table(records, config, f"What {config.model} learned in {minutes}, {SUMMARY_TRIALS} new trials")
    )
    console.print(f"Saved in [bold]{path}[/bold]. Next:", soft_wrap=True)
    console.print(f"  bilateral-rl evaluate {path}", soft_wrap=True, highlight=False)
    console.print(f"  tensorboard --logdir {out}", soft_wrap=True, highlight=False)
    console.print(f"  {_next_training(config, path, out)}", soft_wrap=True, highlight=False)


def _next_training(config: TrainConfig, path: str, out: str) -> str:
    """What one might train next."""
    if isinstance(config, BPTTConfig):
        same = f"--model {config.model} --task {config.task}"
        return f"bilateral-rl train --algo ppo {same} --init-from {path}:{config.seed} --out {out}"
    other = "hold_position" if config.task == "random_reach" else "random_reach"
    return f"bilateral-rl train --model {config.model} --task {other} --out {out}"


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
