import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text
from plain_trials import without_forces
from treatments import treated

from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.envs.arm import ArmParameters
from bilateral_rl.figures.curves import HistoryColumn

REACH, HOLD = "random_reach", "hold_position"


@pytest.fixture
def completion():
    return HistoryColumn("goal_completion_5cm", "Goal completion within 5 cm", "%")


@pytest.fixture
def deviation():
    return HistoryColumn("max_deviation", "Maximal perpendicular deviation", "cm")


@pytest.fixture
def make_results():
    """Builder of a table of results from (model, lesion, protocol): values by seed."""

    def make(metric, values, task=REACH, network="trained"):
        rows = [
            (model, task, "bptt", seed, lesion, *treated(protocol, network), metric.name, value)
            for (model, lesion, protocol), by_seed in values.items()
            for seed, value in enumerate(by_seed)
        ]
        return pd.DataFrame(rows, columns=list(COLUMNS))

    return make


@pytest.fixture
def make_record():
    """Builder of trials of ten steps of 20 ms, all zero but for what is given."""

    def make(n=4, steps=10, **arrays):
        shapes = {
            "joint": (n, steps + 1, 2),
            "hand": (n, steps + 1, 2),
            "target": (n, 2),
            "load": (n, 2),
            "distance": (n, steps),
            "start_distance": (n,),
            "observation": (n, steps, 16),
            "excitation": (n, steps, 6),
            "activation": (n, steps, 6),
            "vector_return": (n, 2),
        }
        zeros = {name: np.zeros(shape, dtype=np.float32) for name, shape in shapes.items()}
        given = zeros | arrays
        rest = without_forces(given["hand"], given["target"], given["load"])
        return TrialRecord(**(rest | given), arm=ArmParameters(timestep=0.02))

    return make


def _artists(axes, gid):
    """What was drawn with the group id ``gid``, from left to right as drawn."""
    return [artist for artist in axes.get_children() if artist.get_gid() == gid]


@pytest.fixture
def artists():
    return _artists


def _hidden_ticks(axis):
    low, high = sorted(axis.get_view_interval())
    ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
    return {label for t in ticks if not low <= t.get_loc() <= high for label in (t.label1, t.label2)}


@pytest.fixture
def assert_texts_are_apart():
    """Check that all text of a figure lies inside it and none over another."""

    def check(figure):
        figure.draw_without_rendering()
        hidden = set().union(*(_hidden_ticks(axis) for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)))
        texts = [t for t in figure.findobj(Text) if t.get_visible() and t.get_text().strip() and t not in hidden]
        boxes = [(text.get_text(), text.get_window_extent()) for text in texts]
        for i, (text, box) in enumerate(boxes):
            assert figure.bbox.x0 - 1 < box.x0, text
            assert box.x1 < figure.bbox.x1 + 1, text
            assert figure.bbox.y0 - 1 < box.y0, text
            assert box.y1 < figure.bbox.y1 + 1, text
            for other, other_box in boxes[:i]:
                assert not box.padded(-0.5).overlaps(other_box), (text, other)
        return len(boxes)

    return check
