"""One look for all figures: sizes, and a color, marker and line for each model."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import matplotlib
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bilateral_rl.config.catalogue import MODELS

WIDTH = 6.0
"""Width of figures (inches): narrow, so that text stays legible where they are shown 400 pixels wide."""
NOTE_SIZE, TEXT_SIZE, LABEL_SIZE, TITLE_SIZE = 7.5, 8.5, 9.0, 10.0
"""Sizes of text (points): of remarks, of ticks and legends, of axes, of titles."""
_NOTE_CHARACTERS, _LEGEND_CHARACTERS = 92, 96
"""Characters in a line as wide as the figure; a legend's entry takes six more than its words."""
INK, FAINT = "0.2", "0.9"


class ModelStyle(NamedTuple):
    """Look of a model; the marker and the line tell models apart where there is no color."""

    color: str
    marker: str
    line: Any


MODEL_STYLES = {
    "uni_b": ModelStyle("#9a9a9a", "o", (0, (4, 1.5))),
    "uni_dl": ModelStyle("#252525", "^", "-"),
    "uni_ndl": ModelStyle("#636363", "v", (0, (1, 1))),
    "bi_ns": ModelStyle("#6baed6", "s", (0, (4, 1.5))),
    "bi_s": ModelStyle("#08519c", "D", "-"),
    "cc_ns": ModelStyle("#fd8d3c", "P", (0, (4, 1.5))),
    "cc_s": ModelStyle("#a63603", "X", "-"),
}
"""Look of each model: a hue for each architecture, darker where a model is trained to be specialized. Blue, orange and
grey differ for color-blind people too."""
OTHER_STYLE = ModelStyle("#35978f", "h", "-")
"""Look of a name that is not in the catalogue."""


def forget_working_folder() -> None:
    """Undo the settings of a ``matplotlibrc`` in the working folder.

    That may be somebody else's run, and the settings could turn LaTeX on, which executes more than anybody wants.
    """
    if matplotlib.matplotlib_fname() == "matplotlibrc":
        matplotlib.rcdefaults()


forget_working_folder()


def model_style(name: str) -> ModelStyle:
    """Return the look of the model called ``name``."""
    return MODEL_STYLES.get(name, OTHER_STYLE)


def in_order(models: Iterable[str]) -> list[str]:
    """Return each model once: those of the catalogue in its order, then others by name."""
    names = set(models)
    return [name for name in MODELS if name in names] + sorted(names - set(MODELS))


def families(models: Iterable[str]) -> list[list[str]]:
    """Return models in order and grouped by architecture; a name that is not in the catalogue stays alone."""
    groups: dict[str, list[str]] = {}
    for name in in_order(models):
        groups.setdefault(MODELS[name].architecture if name in MODELS else name, []).append(name)
    return list(groups.values())


def new_figure(height: float) -> Figure:
    """Return an empty figure of the common width, ``height`` inches high, that draws without a display."""
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def style_axes(axes: Axes, x_label: str = "", y_label: str = "", title: str = "") -> None:
    """Give ``axes`` the common look and its labels."""
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.grid(axis="y", color=FAINT, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=TEXT_SIZE)
    axes.set_xlabel(x_label, fontsize=LABEL_SIZE)
    axes.set_ylabel(y_label, fontsize=LABEL_SIZE)
    if title:
        axes.set_title(title, fontsize=LABEL_SIZE)


def set_title(figure: Figure, title: str) -> None:
    """Set the title of the whole figure."""
    figure.suptitle(title, fontsize=TITLE_SIZE)


def set_note(figure: Figure, note: str) -> None:
    """Set a remark below the figure that says what its marks mean; long lines are broken."""
    lines = [line for paragraph in note.splitlines() for line in textwrap.wrap(paragraph, _NOTE_CHARACTERS)]
    figure.supxlabel("\n".join(lines), fontsize=NOTE_SIZE, color="0.3")


def set_title_and_legend(figure: Figure, title: str, handles: Sequence[Artist], words: Sequence[str]) -> None:
    """Set the title of the whole figure and, below it, a legend."""
    columns = max(1, _LEGEND_CHARACTERS // (max(map(len, words), default=0) + 6))
    figure.legend(
        handles, words, title=title, title_fontsize=TITLE_SIZE, fontsize=TEXT_SIZE,
        loc="outside upper center", ncols=columns, handletextpad=0.4, columnspacing=1.5, frameon=False, borderaxespad=0,
    )  # fmt: skip


def marker_handle(marker: str, filled: bool) -> Line2D:
    """Return a marker for a legend, in neutral grey."""
    face = INK if filled else "white"
    return Line2D([], [], linestyle="", marker=marker, markersize=6, color=INK, markerfacecolor=face)


def legend_above(axes: Axes, columns: int = 1) -> None:
    """Draw the legend of ``axes`` in the place of its title."""
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), fontsize=TEXT_SIZE, frameon=False, ncols=columns)
