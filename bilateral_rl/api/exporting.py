"""Runs as folders to publish, measured first."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bilateral_rl.analysis.metrics import measure, metrics_of, preferred_by_hand
from bilateral_rl.api.checks import as_path
from bilateral_rl.api.evaluation import evaluate
from bilateral_rl.api.run import Run
from bilateral_rl.runs.export import check_free, exported_config, write_export
from bilateral_rl.runs.export_card import Measured, model_card


def export(run: Run, out: str | Path, *, trials: int, seed: int, weights: str) -> Run:
    """Test a run's networks and write them as a folder to publish (:meth:`Run.export`).

    Raises:
        UserError: what cannot be tested or written; nothing is left then.
    """
    folder = as_path("--out", out)
    check_free(folder)
    records = evaluate(run, trials, seed, weights=weights).records
    config = exported_config(run.folder, run.only)
    task, radius = config.make_task(), config.trial.threshold
    by_hand = preferred_by_hand(task, radius)
    metrics = [metric for metric in metrics_of(task, [radius]) if metric.hand is None or metric.name in by_hand]
    of_seeds = [measure(record, metrics) for record in records.values()]
    measures = [
        Measured(metric.name, metric.label, metric.unit, [values[metric.name] for values in of_seeds])
        for metric in metrics
    ]
    returns = np.concatenate([record.vector_return.mean(axis=1) for record in records.values()])
    tests = f"Means over {trials:,} trials, those of `bilateral-rl evaluate FOLDER --trials {trials} --seed {seed}`"
    card = model_card(config, measures, (float(returns.mean()), float(returns.std())), tests)
    return Run(write_export(run.folder, run.only, weights, folder, card))
