"""The history of a stacked training: what it says of each seed and epoch, and how a saved one is read."""

from __future__ import annotations

import itertools

import torch
from torch import Tensor

from bilateral_rl.analysis.metric import ROLES, Role
from bilateral_rl.analysis.modulation import TAGS_OF
from bilateral_rl.analysis.trial_records import OF_REACHES
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.state import TrainingState
from bilateral_rl.bptt.targets import Targets
from bilateral_rl.config.schema import BPTTConfig
from bilateral_rl.envs.tasks import Task
from bilateral_rl.vocabulary import SIDES, stream_names

MEASURES = ("goal_completion_percent", "time_in_goal_steps", "final_error_cm")
"""Measures of the validation trials that the history holds, named as in evaluations."""


def history_columns(config: BPTTConfig, layout: Layout) -> list[str]:
    """Return the names of what the history of a seed holds, an epoch a row.

    That is the mean loss of each stream and gradient norm of each group over the epoch's updates; then loss and
    measures on the validation trials, of two arms also by hand and role, and what each side supplied in them if the
    network has sides.
    """
    return [
        *(f"loss_{name}" for name in stream_names(config.spec.loss)),
        *(f"gradient_norm_{group}" for group in groups(layout)),
        "validation_loss",
        *MEASURES,
        *(f"{name}_of_{SIDES[arm]}_{role}" for arm, role, names in _of_hands(config.make_task()) for name in names),
        *_side_columns(layout),
    ]


def measured(targets: Targets, network: int, config: BPTTConfig) -> list[float]:
    """Return what the history holds of how well a network did in its validation trials.

    Where hands reach and others hold, the completion over all of them is of those that reach.
    """
    task, threshold, reaches = config.make_task(), config.trial.threshold, targets.reaches[network]

    def means(rows: Tensor) -> dict[str, float]:
        return targets.measures(network, threshold, rows).means() if rows.any() else dict.fromkeys(MEASURES, torch.nan)

    of_all = means(torch.ones_like(reaches))
    if len(task.roles) > 1:
        of_all |= {name: value for name, value in means(reaches).items() if name in OF_REACHES}
    values = [of_all[name] for name in MEASURES]
    arm_of = torch.arange(len(reaches), device=reaches.device) % task.n_arms
    for arm, role, names in _of_hands(task):
        of_hand = means((arm_of == arm) & (reaches == (role == "reach")))
        values += [of_hand[name] for name in names]
    return values


def groups(layout: Layout) -> list[str]:
    """Return the network's parameter groups, in the order of its variables."""
    return list(dict.fromkeys(v.group for v in layout.variables))


def read_state(tensors: dict[str, Tensor], config: BPTTConfig, layout: Layout) -> TrainingState:
    """Return the state that a training of ``config`` saved.

    Up to version 0.2.0 the history did not say what the sides supplied: there it holds NaN.

    Raises:
        ValueError: it is no such state.
    """
    n_columns, n_of_sides = len(history_columns(config, layout)), len(_side_columns(layout))
    history = tensors.get("history")
    if history is not None and history.ndim == 3 and history.shape[2] == n_columns - n_of_sides:
        unknown = history.new_full((*history.shape[:2], n_of_sides), torch.nan)
        tensors = tensors | {"history": torch.cat([history, unknown], dim=2)}
    return TrainingState.from_tensors(tensors, len(config.all_seeds), layout.width, n_columns)


def _of_hands(task: Task) -> list[tuple[int, Role, list[str]]]:
    """Return arm and role of each hand of two that there is in ``task``, with the measures that are told of it."""
    if task.n_arms == 1:
        return []
    return [
        (arm, role, [name for name in MEASURES if role == "reach" or name not in OF_REACHES])
        for arm, role in itertools.product(range(task.n_arms), ROLES)
        if role in task.roles
    ]


def _side_columns(layout: Layout) -> tuple[str, ...]:
    """Return the names of what the history holds about the sides, its last columns; there are none of one side."""
    return tuple(TAGS_OF[layout.shape.arms]) if layout.shape.sides == 2 else ()
