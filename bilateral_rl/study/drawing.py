"""Every figure of a study, with what each shows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import pandas as pd
from matplotlib.figure import Figure

from bilateral_rl.analysis.comparison import compare
from bilateral_rl.analysis.metrics import find_metric, metric_name, preferred_metric
from bilateral_rl.analysis.modulation import Contributions, contributions_in
from bilateral_rl.analysis.results import protocol_words, protocols_in
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.envs.task_specs import TASK_SPECS
from bilateral_rl.figures.curves import FINAL_ERROR, PREFERRED, VALIDATION_LOSS, learning_curves
from bilateral_rl.figures.hemispheres import hemisphere_activity
from bilateral_rl.figures.labels import model_label, task_label
from bilateral_rl.figures.lesions import lesion_effects
from bilateral_rl.figures.models import model_comparison
from bilateral_rl.figures.posthoc import posthoc_matrix
from bilateral_rl.figures.specialization import specialization
from bilateral_rl.figures.specialization_over_training import specialization_over_training
from bilateral_rl.figures.trials import hand_paths, muscle_activity, speed_profiles
from bilateral_rl.policies.networks import BilateralNetwork
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import load_policy
from bilateral_rl.study.outcome import learning_history
from bilateral_rl.training.probe_table import read_probes
from bilateral_rl.vocabulary import TEST_SEED

TRIALS, TRIALS_SEED = 128, TEST_SEED
"""Number and seed of the trials that figures show."""
_COMPARED = {
    "random_reach": ("goal_completion", "speed_to_goal", "effort", "sparc"),
    "hold_position": ("time_in_goal", "hold_speed", "effort"),
}
_TESTED = ("goal_completion", "speed_to_goal", "time_in_goal")
"""Metrics of which every pair of models is tested."""
_MUSCLES_OF = ("uni_dl", "uni_ndl", "cc_s")


@dataclass(frozen=True)
class Drawing:
    """A figure and what it shows."""

    name: str
    """Name of its files, without suffix."""
    caption: str
    figure: Figure


def draw_study(
    results: pd.DataFrame, radii: Mapping[str, float], runs: Mapping[str, Mapping[str, list[RunFolder]]]
) -> Iterator[Drawing]:
    """Draw what a study found, figure by figure.

    Args:
        results: the long table (:mod:`bilateral_rl.analysis.results`).
        radii: radius of the goal by task (m).
        runs: the runs that are done, by task and model.
    """
    for task, radius in radii.items():
        if task in set(results["task"]):
            yield from _draw_models(results, task, radius)
    yield from _draw_lesions(results, radii)
    for task, radius in radii.items():
        if runs.get(task):
            yield from _draw_runs(task, radius, runs[task])


def compared_metrics(task: str, radius: float) -> list[str]:
    """Return the names of the metrics by which a task's models are compared, the preferred one first."""
    return [metric_name(name, radius) for name in _COMPARED[task]]


def _draw_models(results: pd.DataFrame, task: str, radius: float) -> Iterator[Drawing]:
    names = compared_metrics(task, radius)
    if results.loc[results["task"] == task, "model"].nunique() < 2:
        return
    figure = model_comparison(results, task, [find_metric(name) for name in names])
    yield Drawing(f"models_{task}", f"{task_label(task)}: the intact models; a dot a seed.", figure)
    for name in [name for name in names if name.startswith(_TESTED)]:
        comparison = compare(results, name, task)
        for test, column in (("Games–Howell", "p_games_howell"), ("Tukey's HSD", "p_tukey")):
            title = f"{task_label(task)}: {find_metric(name).label}, {test}"
            figure = posthoc_matrix(comparison.pairs, column, find_metric(name), title)
            yield Drawing(f"posthoc_{task}_{name}_{column.removeprefix('p_')}", f"{title}.", figure)


def _draw_lesions(results: pd.DataFrame, radii: Mapping[str, float]) -> Iterator[Drawing]:
    metrics = {task: find_metric(preferred_metric(task, radius)) for task, radius in radii.items()}
    present = set(results["model"])
    models = [name for name, model in MODELS.items() if name in present and model.architecture != "unilateral"]
    if not models:
        return
    for task, metric in metrics.items():
        if task in set(results["task"]):
            caption = f"{task_label(task)}: {metric.label} after each lesion, by what followed it."
            yield Drawing(f"lesions_{task}", caption, lesion_effects(results, task, metric, models))
    for protocol in protocols_in(results):
        words = protocol_words(protocol)
        caption = f"Specialization index of the hemispheres, {words}: above 0 the dominant one does more alone."
        figure = specialization(results, metrics, models, protocol)
        yield Drawing(f"specialization_{protocol}", caption, figure)


def _draw_runs(task: str, radius: float, runs: Mapping[str, list[RunFolder]]) -> Iterator[Drawing]:
    label = task_label(task)
    yield draw_learning(task, runs)
    probes = read_probes(run for folders in runs.values() for run in folders)
    if len(probes):
        caption = f"{label}: what each hemisphere does alone, as its network learns."
        yield Drawing(f"specialization_{task}_over_training", caption, specialization_over_training(probes, task))
    first = {model: _FirstSeed(task, folders[0]) for model, folders in runs.items()}
    records = {model: [seed.record] for model, seed in first.items()}
    title = f"{label}: {TRIALS} trials of the first seed"
    yield Drawing(f"speed_{task}", f"{label}: speed of the hand.", speed_profiles(records, title))
    few = {model: records[model] for model in _MUSCLES_OF if model in records}
    if few:
        yield Drawing(f"muscles_{task}", f"{label}: activation of the muscles.", muscle_activity(few, title))
    sides = {model: seed.contributions for model, seed in first.items() if seed.contributions}
    if sides:
        step = next(iter(first.values())).record.arm.timestep
        caption = f"{label}: what each hemisphere contributes."
        yield Drawing(f"hemispheres_{task}", caption, hemisphere_activity(sides, step, title))
    for model, seed in first.items():
        caption = f"{label}: hand paths of {model_label(model)}, from the dot to the disc."
        yield Drawing(f"paths_{task}_{model}", caption, _paths(seed.record, radius, model))


def _paths(record: TrialRecord, radius: float, model: str) -> Figure:
    """Draw hand paths under the model's name."""
    figure = hand_paths(record, radius, sum(record.arm.link_length))
    (axes,) = figure.axes
    axes.set_title(f"{model_label(model)}: {axes.get_title()}", fontsize=10)
    return figure


def draw_learning(task: str, runs: Mapping[str, list[RunFolder]]) -> Drawing:
    """Draw how the networks of each model learned a task."""
    label = task_label(task)
    history = learning_history(runs)
    supervised, judged = "epoch" in history, PREFERRED[TASK_SPECS[task].judged_by]
    measures = [VALIDATION_LOSS, judged] if supervised else [judged, FINAL_ERROR]
    figure = learning_curves(history, measures, f"{label}: learning", "epoch" if supervised else "timesteps")
    return Drawing(f"learning_{task}", f"{label}: how the networks learned.", figure)


class _FirstSeed:
    """The trials of the first seed of a run, and what its hemispheres contribute if it has any."""

    def __init__(self, task: str, run: RunFolder) -> None:
        config = run.config()
        policy = load_policy(run, seed=config.seed)
        self.record: TrialRecord = Evaluator(task, config.trial, TRIALS, TRIALS_SEED).run(policy)
        network = policy.motor_network
        self.contributions: Contributions | None = None
        if isinstance(network, BilateralNetwork):
            self.contributions = contributions_in(network, self.record)
