"""Figures of trials."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from bilateral_rl.evaluation import TrialRecord


def hand_paths(record: TrialRecord, threshold: float, reach: float, n_trials: int = 12) -> Figure:
    """Paths of the first trials' hands: start as a dot, goal as a circle, one color a trial.

    Args:
        record: the trials.
        threshold: radius of the goal (m).
        reach: length of the stretched arm (m).
        n_trials: how many to draw.
    """
    figure = Figure(figsize=(5, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.add_patch(Circle((0, 0), 100 * reach, fill=False, color="0.85"))
    for i, (path, target) in enumerate(zip(100 * record.hand[:n_trials], 100 * record.target[:n_trials], strict=True)):
        color = f"C{i % 10}"
        axes.add_patch(Circle(tuple(target), 100 * threshold, color=color, alpha=0.2, linewidth=0))
        axes.plot(*path.T, color=color, linewidth=1.5)
        axes.plot(*path[0], "o", color=color, markersize=5)
    axes.plot(0, 0, "k+", markersize=8)
    limit = 105 * reach
    axes.set(xlim=(-limit, limit), ylim=(-0.35 * limit, limit), aspect="equal")
    axes.set(xlabel="hand x (cm), shoulder at +", ylabel="hand y (cm)")
    axes.set_title(f"Hand paths of {min(n_trials, len(record.hand))} trials", fontsize=10)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure


def as_array(figure: Figure) -> np.ndarray:
    """(height, width, 3) RGB picture of ``figure``."""
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()
