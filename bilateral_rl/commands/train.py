"""`bilateral-rl train`."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from bilateral_rl.analysis.modulation import side_modulations
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.api.training import go_on, start
from bilateral_rl.commands.training_report import print_measures, sides_line
from bilateral_rl.config.code_tasks import is_code
from bilateral_rl.config.parse import parse_overrides
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.envs.experiments.files import experiment_named
from bilateral_rl.envs.task_specs import PARADIGMS, TASK_SPECS
from bilateral_rl.io.yaml_files import read_settings
from bilateral_rl.training.progress import Outcome
from bilateral_rl.vocabulary import TEST_SEED, TEST_TRIALS

SUMMARY_TRIALS, SUMMARY_SEED = TEST_TRIALS, TEST_SEED
"""Trials of the table at the end; `evaluate` has the same by default, so that both print the same numbers."""


def train(
    algo: str | None,
    model: str | None,
    task: str | None,
    seeds: str | None,
    flags: Mapping[str, Any],
    config_file: Path | None,
    overrides: Sequence[str],
    out: Path,
    console: Console,
) -> None:
    """Train from scratch: tuned defaults < file < --set < flags."""
    layers = [read_settings(config_file)] if config_file else []
    layers.append(parse_overrides(overrides))
    _report(start(algo, model, task, seeds, flags, layers, out, console), console)


def resume(path: Path, requested: Mapping[str, Any], console: Console) -> None:
    """Go on with a run."""
    _report(go_on(path, requested, console), console, " in this session")


def _report(outcome: Outcome, console: Console, session: str = "") -> None:
    """Print how a training ended; ``session`` follows the time where that is not the whole training's."""
    config = outcome.folder.config()
    path = escape(shlex.quote(str(outcome.folder.path)))
    minutes = f"{outcome.seconds / 60:.1f} minutes{session}"
    if outcome.stopped_by is not None:
        _print_notes(outcome, console)
        of_seeds = " of all seeds" if config.seeds > 1 and config.unit == "steps" else ""
        console.print(
            f"Stopped after {outcome.done:,} {config.unit}{of_seeds} and {minutes}; saved in [bold]{path}[/bold]."
        )
        track = " --track" if config.to_values().get("track") else ""
        console.print(f"Go on with: bilateral-rl train --resume {path}{track}", soft_wrap=True)
        sys.exit(128 + outcome.stopped_by)
    evaluator = Evaluator(config.make_task(), config.trial, SUMMARY_TRIALS, SUMMARY_SEED, config.device)
    learned = f"has learned ({minutes})" if session else f"learned in {minutes}"
    records = {seed: evaluator.run(policy) for seed, policy in outcome.policies.items()}
    print_measures(records, config, f"What {config.model} {learned}, {SUMMARY_TRIALS} new trials", console)
    networks = {seed: policy.motor_network for seed, policy in outcome.policies.items()}
    if modulations := side_modulations(networks, records):
        console.print(sides_line(modulations), highlight=False, soft_wrap=True)
    _print_notes(outcome, console)
    console.print(f"Saved in [bold]{path}[/bold]. Next:", soft_wrap=True)
    named = f"{path} --task {config.task}" if is_code(config.task) else path
    console.print(f"  bilateral-rl evaluate {named}", soft_wrap=True, highlight=False)
    if config.spec.architecture != "unilateral":
        console.print(f"  bilateral-rl lesion {named}", soft_wrap=True, highlight=False)
    console.print(f"  bilateral-rl render {named}", soft_wrap=True, highlight=False)
    out = outcome.folder.path.parent.parent
    console.print(f"  tensorboard --logdir {escape(shlex.quote(str(out)))}", soft_wrap=True, highlight=False)
    console.print(f"  {_next_training(config, path, out)}", soft_wrap=True, highlight=False)


def _print_notes(outcome: Outcome, console: Console) -> None:
    for note in outcome.notes:
        console.print(f"[yellow]Note:[/yellow] {escape(note)}", soft_wrap=True, highlight=False)


def _is_known_by_name(config: TrainConfig) -> bool:
    """Whether ``--task`` and the task's name lead to it: a file of one's own needs its path, which a run forgets."""
    experiment = config.experiment
    return experiment is None or (config.task in PARADIGMS and experiment == experiment_named(config.task))


def _next_training(config: TrainConfig, path: str, out: Path) -> str:
    """Suggest what to train next, into the same folder of runs."""
    into = "" if out == Path("runs") else f" --out {escape(shlex.quote(str(out)))}"
    if config.algo == "bptt":
        task = config.task if _is_known_by_name(config) else f"{path}/config.yaml"
        same = f"--model {config.model} --task {task}"
        return f"bilateral-rl train --algo ppo {same} --init-from {path}:{config.seed}{into}"
    if config.task not in TASK_SPECS:
        code = f" --task {config.task}" if is_code(config.task) else ""
        return f"bilateral-rl record {path} --out trials.csv{code}"
    others = (task for task, spec in TASK_SPECS.items() if spec.n_arms == config.n_arms)
    other = next(task for task in others if task != config.task)
    return f"bilateral-rl train --model {config.model} --task {other}{into}"
