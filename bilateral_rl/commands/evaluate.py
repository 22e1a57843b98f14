"""`bilateral-rl evaluate`."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from rich.console import Console
from rich.markup import escape

from bilateral_rl.analysis.breakdowns import check_breakdown
from bilateral_rl.analysis.trial_records import TrialRecord, reported_radii, summaries
from bilateral_rl.api import evaluation as api
from bilateral_rl.api.run import find_run
from bilateral_rl.commands.parts_table import parts_table
from bilateral_rl.commands.training_report import print_measures, sides_table
from bilateral_rl.commands.writing import apart_from, json_ready, write
from bilateral_rl.config.parse import parse_overrides
from bilateral_rl.policies.lesions import INTACT, lesion_words


def evaluate(
    *,
    run: str,
    trials: int,
    seed: int,
    deterministic: bool,
    weights: str,
    lesion: str,
    task: str | None,
    overrides: Sequence[str],
    by: str | None,
    csv: Path | None,
    json_file: Path | None,
    console: Console,
) -> None:
    """Test a run's policies, or one of them; perhaps write, and print, their measures.

    Args:
        run: RUN, or RUN:SEED for one policy of it.
        trials: number of trials.
        seed: seed of the first trial.
        deterministic: whether the policies act by the mean of their actions.
        weights: which of the run's weights.
        lesion: "intact" or a lesion of every network.
        task: another task than the run's.
        overrides: other settings of trials, ``["trial.sensory_noise=0.01"]``.
        by: what trials are taken apart by; None for nothing.
        csv: file for one row a trial, or what they are taken apart by; "-" for the terminal, None for no file.
        json_file: file for the table, likewise.
        console: where to print.

    Raises:
        UserError: a run that cannot be tested, or a file that cannot be written; the table is printed all the same.
    """
    if by is not None:
        check_breakdown(by)
    console = apart_from(console, csv, json_file)
    made = api.evaluate(
        find_run(run), trials, seed, lesion=lesion, task=task,
        settings=parse_overrides(overrides, "trial.sensory_noise=0.01"), deterministic=deterministic, weights=weights,
    )  # fmt: skip
    head = {"run": run, "weights": weights, "trials": trials, "seed": seed, "deterministic": deterministic}
    head |= {"task": made.under.task, "lesion": lesion, "changed": dict(made.under.changed)}
    head["notes"] = list(made.under.notes)
    parts = None if by is None else made.taken_apart(by)
    try:
        _write(made, head, parts, csv, json_file)
    finally:
        title = "; ".join([f"{run} ({weights}), {trials} trials of seed {seed}", *_deviations(made)])
        print_measures(made.records, made.config, title, console)
        if parts is not None:
            console.print(parts_table(parts, made.metrics, made.config.judged_by))
        if made.modulations:
            console.print(sides_table(made.modulations))
        for note in made.under.notes:
            console.print(f"[yellow]Note:[/yellow] {escape(note)}", soft_wrap=True, highlight=False)


def _deviations(made: api.Evaluation) -> Iterator[str]:
    """Say what is lesioned, and in what the test differs from the training or from another task's usual test."""
    if made.lesion != INTACT:
        yield f"lesion: {lesion_words(made.lesion)}"
    for name, value in made.under.changed.items():
        yield f"{name} = {value}"


def _write(
    made: api.Evaluation,
    head: Mapping[str, Any],
    parts: pd.DataFrame | None,
    csv: Path | None,
    json_file: Path | None,
) -> None:
    """Write the files that are requested: a row a trial or part, and the tables, headed by what was tested."""
    if csv is not None:
        write(csv, (made.by_trial() if parts is None else parts).to_csv(index=False))
    if json_file is not None:
        threshold = made.config.trial.threshold
        by_seed = {seed: _by_threshold(record, threshold) for seed, record in made.records.items()}
        measures: dict[str, Any] = {"by_threshold_m": _means(list(by_seed.values())), "by_seed": by_seed}
        if any(record.n_arms > 1 for record in made.records.values()):
            measures["by_hand"] = list(_by_hand(made))
        if made.modulations:
            sides = {seed: modulation.measures() for seed, modulation in made.modulations.items()}
            measures["sides"] = {**_mean(list(sides.values())), "by_seed": sides}
        if parts is not None:
            measures["parts"] = parts.to_dict("records")
        write(json_file, json.dumps(json_ready({**head, **measures}), indent=2, allow_nan=False) + "\n")


def _by_threshold(record: TrialRecord, threshold: float) -> dict[str, dict[str, float]]:
    return {f"{radius:g}": values for radius, values in summaries(record, threshold).items()}


def _by_hand(made: api.Evaluation) -> Iterator[dict[str, Any]]:
    """Yield a row a seed, radius, hand and role."""
    for seed, record in made.records.items():
        for radius in reported_radii(made.config.trial.threshold):
            for (hand, role), means in record.summaries_by_hand(radius).items():
                yield {"seed": seed, "threshold_m": radius, "hand": hand, "role": role, **means}


def _means(tables: Sequence[dict[str, dict[str, float]]]) -> dict[str, dict[str, float]]:
    """Means over the seeds, of what is a number in any."""
    return {radius: _mean([table[radius] for table in tables]) for radius in tables[0]}


def _mean(rows: Sequence[dict[str, float]]) -> dict[str, float]:
    return {name: float(pd.Series([row[name] for row in rows]).mean()) for name in rows[0]}
