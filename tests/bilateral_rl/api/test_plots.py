"""Figures in a given axis: what they show, and what they refuse."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from two_arm_recordings import two_arms

import bilateral_rl as brl
from bilateral_rl.analysis.kinematics import hand_speed
from bilateral_rl.analysis.results import State, by_seed
from bilateral_rl.io.errors import UserError


@pytest.fixture
def ax():
    figure = Figure()
    FigureCanvasAgg(figure)
    return figure.subplots()


@pytest.fixture
def recording(loaded):
    return loaded.record(5, lesion=["intact", "callosum"], progress=False)


@pytest.fixture
def around_a_center(recording):
    """The recording, as if each network had reached for two targets in turn."""
    hand = recording["hand"]
    target = hand[:, 0] + np.where(recording["trial"][:, None] % 2, (0.1, 0), (0, 0.1))
    seen = np.repeat(target[:, None], hand.shape[1] - 1, axis=1)
    return dataclasses.replace(recording, arrays={**recording.arrays, "target": target, "seen_target": seen})


@pytest.fixture
def blocks():
    """Five blocks of two seeds, whose deviations mirror each other."""
    rows = [
        (seed, block, condition, sign * (1.0 + seed) * block, np.nan if condition != "channel" else 0.1 * block)
        for seed in range(2)
        for block in range(5)
        for condition, sign in (("field", 1), ("null", -1), ("channel", 0))
    ]
    return pd.DataFrame(rows, columns=["seed", "block", "condition", "deviation_at_peak_speed", "channel_compensation"])


@pytest.fixture
def results(loaded):
    return loaded.lesion(["callosum", "deep_dominant"], "none", trials=4, progress=False)


def test_paths_are_of_one_network_and_lesion(recording, ax):
    assert brl.plot_paths(recording, ax, seed=1, lesion="callosum", trials=3) is ax
    rows = (recording["seed"] == 1) & (recording["lesion"] == "callosum")
    paths = [line for line in ax.lines if len(line.get_xdata()) > 1]
    for line, hand in zip(paths, recording["hand"][rows][:3], strict=True):
        np.testing.assert_allclose(np.transpose(line.get_data()), 100 * hand, rtol=1e-6)
    goals = [patch for patch in ax.patches if patch.get_fill()]
    np.testing.assert_allclose([goal.center for goal in goals], 100 * recording["target"][rows][:3], rtol=1e-6)
    assert {goal.radius for goal in goals} == {5.0}
    assert ax.get_title() == "3 trials, seed 1, callosum"


def test_center_out_has_a_hue_for_each_target(around_a_center, ax):
    assert brl.plot_center_out(around_a_center, ax, seed=1, lesion="intact") is ax
    rows = (around_a_center["seed"] == 1) & (around_a_center["lesion"] == "intact")
    hand = 100 * (around_a_center["hand"] - around_a_center["hand"][:, :1])[rows]
    to_the_right, upward = [line.get_xydata() for line in ax.lines if line.get_gid() == "mean"]
    np.testing.assert_allclose(to_the_right, hand[1::2].mean(axis=0), atol=1e-5)
    np.testing.assert_allclose(upward, hand[::2].mean(axis=0), atol=1e-5)
    assert ax.get_title() == "5 trials, seed 1, intact"


def test_trials_without_a_cue_are_no_reaches(around_a_center, ax):
    seen = around_a_center["seen_target"].copy()
    is_third = around_a_center["trial"] == 3
    seen[is_third] = around_a_center["hand"][is_third, :1]
    target = np.where(is_third[:, None], around_a_center["hand"][:, 0], around_a_center["target"])
    arrays = {**around_a_center.arrays, "target": target, "seen_target": seen}
    brl.plot_center_out(dataclasses.replace(around_a_center, arrays=arrays), ax, seed=0, lesion="intact")
    assert len([line for line in ax.lines if line.get_gid() == "trial"]) == 4


def test_speeds_are_aligned_to_the_cue(around_a_center, ax):
    hand, seen = around_a_center["hand"], around_a_center["seen_target"].copy()
    cue = around_a_center["trial"] + 3
    for row, at, start in zip(seen, cue, hand[:, 0], strict=True):
        row[:at] = start
    seen[cue == 7] = hand[cue == 7, :1]  # no cue
    arrays = {**around_a_center.arrays, "seen_target": seen}
    brl.plot_speeds(dataclasses.replace(around_a_center, arrays=arrays), ax)
    assert ax.get_xlabel() == "Time from the cue (ms)"
    of_intact = (around_a_center["lesion"] == "intact") & (cue < 7)
    speed = 100 * hand_speed(hand[of_intact], around_a_center.timestep)
    (line,) = [line for line in ax.lines if line.get_label() == "intact"]
    x, y = line.get_data()
    expected = np.mean([row[at] for row, at in zip(speed, cue[of_intact], strict=True)])
    assert y[np.isclose(x, 5)].item() == pytest.approx(expected, rel=1e-5)
    assert x[0] == pytest.approx(-45)  # half of the cues come at the fifth step or later: four steps and a half before


def test_a_channel_shows_the_force_of_the_hand_beside_the_one_that_would_cancel_the_field(loaded, ax):
    with pytest.raises(UserError, match="no trials in a channel"):
        brl.plot_channel(loaded.record(2, task="center_out", progress=False), seed=0)
    share = {"experiment.forces.channel.share": 0.5}
    recording = loaded.record(8, task="curl_field", settings=share, progress=False)
    assert brl.plot_channel(recording, ax, seed=1) is ax
    rows = (recording["seed"] == 1) & (recording["condition"] == "channel")
    assert 0 < rows.sum() < 8
    start, goal = recording["hand"][rows, :1], recording["target"][rows][:, None]
    along = (goal - start) / np.linalg.norm(goal - start, axis=2, keepdims=True)
    lines = {line.get_label(): line.get_ydata() for line in ax.lines}
    for words, of in (("on the wall", recording["force"]), ("would cancel the field", recording["field_force"])):
        to_the_left = along[..., 0] * of[rows][..., 1] - along[..., 1] * of[rows][..., 0]
        np.testing.assert_allclose(lines[words], -to_the_left.mean(axis=0), atol=1e-5)
    assert ax.get_title().endswith("trials, seed 1, intact")


def test_blocks_have_a_line_a_condition(blocks, ax):
    assert brl.plot_blocks(blocks, ax) is ax
    field, null = [next(line for line in ax.lines if line.get_gid() == gid) for gid in ("field", "null")]
    np.testing.assert_allclose(field.get_ydata(), 1.5 * np.arange(5))
    np.testing.assert_allclose(null.get_ydata(), -1.5 * np.arange(5))
    assert (ax.get_xlabel(), len(ax.get_legend().get_texts())) == ("Block", 2)


def test_compensation_is_that_in_the_channel(blocks, ax):
    brl.plot_blocks(blocks, ax, measure="channel_compensation")
    (line,) = [line for line in ax.lines if line.get_gid() == "channel"]
    np.testing.assert_allclose(line.get_ydata(), 0.1 * np.arange(5))


@pytest.mark.parametrize("wrong", ["final_error", "condition"])
def test_a_measure_that_no_block_has_is_refused(blocks, wrong):
    with pytest.raises(UserError, match=f"no {wrong} by block; choose a measure from deviation_at_peak_speed, channel"):
        brl.plot_blocks(blocks, measure=wrong)
    with pytest.raises(UserError, match="`blocks` must be a table of blocks"):
        brl.plot_blocks(blocks[["seed"]])


@pytest.mark.parametrize("size", [(6.4, 4.8), (4.5, 3.0)])
def test_title_and_legend_of_muscles_lie_inside_a_figure_that_lays_nothing_out(recording, size):
    figure = Figure(figsize=size)
    axes = brl.plot_muscles(recording, figure.subplots(), seed=0, lesion="intact")
    figure.draw_without_rendering()
    title, legend = axes.title.get_window_extent(), axes.get_legend().get_window_extent()
    assert title.y1 < figure.bbox.y1
    assert legend.y1 < title.y0
    highest = max(band.get_datalim(axes.transData).y1 for band in axes.collections)
    assert axes.transData.transform((0, highest))[1] < legend.y0 + 4


def test_speeds_have_a_line_a_lesion(recording, ax):
    assert brl.plot_speeds(recording, ax) is ax
    assert [line.get_label() for line in ax.lines] == ["intact", "callosum"]
    of_intact = recording["hand"][recording["lesion"] == "intact"]
    assert len(of_intact) == 3 * 5
    mean = 100 * hand_speed(of_intact, recording.timestep).mean(axis=0)
    np.testing.assert_allclose(ax.lines[0].get_ydata(), mean, rtol=1e-6)
    np.testing.assert_allclose(ax.lines[0].get_xdata()[:2], [5, 15])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Time (ms)", "Hand speed (cm/s)")


def test_muscles_have_a_line_each(recording, ax):
    assert brl.plot_muscles(recording, ax, seed=0, lesion="intact") is ax
    assert "seed 0, intact" in ax.get_title()
    rows = (recording["seed"] == 0) & (recording["lesion"] == "intact")
    means = recording["activation"][rows].mean(axis=0)
    assert [line.get_label() for line in ax.lines][::5] == ["pectoralis", "triceps long"]
    np.testing.assert_allclose([line.get_ydata() for line in ax.lines], means.T, rtol=1e-6)
    assert len({(line.get_color(), line.get_linestyle(), line.get_marker()) for line in ax.lines}) == 6


def test_lesions_are_the_means_of_the_table(results, ax):
    assert brl.plot_lesions(results, ax, metric="final_error") is ax
    means = [line.get_ydata()[0] for line in ax.lines if line.get_gid() == "mean"]
    states = [State("random_reach", "cc_s", lesion) for lesion in ("intact", "deep_dominant", "callosum")]
    assert means == pytest.approx([by_seed(results, "final_error", state).mean() for state in states])
    assert [tick.get_text().replace("\n", " ") for tick in ax.get_xticklabels()] == [
        "intact", "deep dominant", "callosum",
    ]  # fmt: skip
    assert [text.get_text() for text in ax.get_legend().get_texts()] == [
        "without retraining", "fresh networks, treated alike",
    ]  # fmt: skip


def test_curves_are_means_over_seeds_of_each_model(loaded, ax):
    curves = loaded.curves()
    assert brl.plot_curves(pd.concat([curves, curves.assign(model="bi_s")]), ax, measure="validation_loss") is ax
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["Bi-S", "CC-S"]
    (line,) = [line for line in ax.lines if line.get_gid() == "cc_s"]
    first = curves[curves["epoch"] == 1]["validation_loss"].mean()
    assert line.get_ydata()[0] == pytest.approx(first)
    assert ax.get_yscale() == "log"


def test_without_an_axis_there_is_a_new_figure(recording, monkeypatch):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    from matplotlib import pyplot

    axes = [brl.plot_speeds(recording) for _ in range(2)]
    assert axes[0].figure is not axes[1].figure
    assert {one.figure for one in axes} <= {pyplot.figure(number) for number in pyplot.get_fignums()}
    pyplot.close("all")


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda r, t: brl.plot_paths(r), r"There are several \(0, 1, 2\): say which by `seed`"),
        (lambda r, t: brl.plot_paths(r, seed=0), r"There are several \(intact, callosum\): say which by `lesion`"),
        (
            lambda r, t: brl.plot_muscles(r, seed=7, lesion="intact"),
            "There is no seed 7 in this recording; choose from 0, 1, 2",
        ),
        (lambda r, t: brl.plot_paths(r, seed=0, lesion="intact", trials=0), "^`trials` must be at least 1"),
        (
            lambda r, t: brl.plot_center_out(r, seed=0, lesion="intact"),
            "The 5 trials do not repeat 2 to 24 targets around their starts",
        ),
        (lambda r, t: brl.plot_speeds(t), "`recording` must be one, as `run.record"),
        (lambda r, t: brl.plot_speeds(r, [1]), "`ax` must be one axis of matplotlib, such as axes.0., not list"),
        (lambda r, t: brl.plot_lesions(r), "`results` must be a table of lesions"),
        (lambda r, t: brl.plot_lesions(t, metric="hold_speed"), "The table has no hold_speed; choose a metric from"),
        (lambda r, t: brl.plot_lesions(t, model="bi_s"), "There is no model bi_s in this table; choose from cc_s"),
        (lambda r, t: brl.plot_curves(t), "have no axis in common|`curves` must be"),
    ],
)
def test_a_slip_is_a_sentence(recording, results, wrong, says):
    with pytest.raises(UserError, match=says):
        wrong(recording, results)


def test_both_hands_of_a_recording_are_drawn(ax):
    recording = two_arms().recording
    brl.plot_paths(recording, ax, trials=2)
    (first, *_) = [line for line in ax.lines if str(line.get_gid()).startswith("non_dominant")]
    np.testing.assert_allclose(np.transpose(first.get_data()), 100 * recording["hand"][0, :, 1], rtol=1e-5)
    speeds = brl.plot_speeds(recording, Figure().subplots())
    assert [line.get_label() for line in speeds.lines] == [
        "dominant hand, reach", "dominant hand, hold", "non-dominant hand, reach", "non-dominant hand, hold",
    ]  # fmt: skip
    holds = recording["hand"][recording["role"][:, 1] == "hold", :, 1]
    mean = 100 * hand_speed(holds, recording.timestep).mean(axis=0)
    np.testing.assert_allclose(speeds.lines[-1].get_ydata(), mean, rtol=1e-3, atol=1e-2)


def test_figures_of_one_arm_take_one_hand(ax):
    recording = two_arms().recording
    for plot in (brl.plot_muscles, brl.plot_center_out, brl.plot_channel):
        with pytest.raises(UserError, match=r'is of two arms: draw one hand, as by recording.of_hand\("dominant"\)'):
            plot(recording)
    brl.plot_muscles(recording.of_hand("non_dominant", "hold"), ax)
    rows = recording["role"][:, 1] == "hold"
    np.testing.assert_allclose(ax.lines[0].get_ydata(), recording["activation"][rows, :, 1, 0].mean(axis=0), rtol=1e-5)
    arrays = recording.arrays | {"lesion": np.array(["intact", "callosum"] * 2)}
    with pytest.raises(UserError, match="both hands after several lesions"):
        brl.plot_speeds(dataclasses.replace(recording, arrays=arrays))


def test_curves_by_hand_have_a_line_for_each_hand_in_each_role(loaded, ax):
    curves = loaded.curves()
    with pytest.raises(
        UserError, match="no goal_completion_percent by hand, as trainings of two arms have: leave `by_"
    ):
        brl.plot_curves(curves, by_hand=True)
    measures = {"dominant_reach": 30.0, "non_dominant_reach": 20.0, "dominant_hold": np.nan}
    curves = curves.assign(**{f"goal_completion_percent_of_{of}": value for of, value in measures.items()})
    brl.plot_curves(curves, ax, by_hand=True)
    drawn = {line.get_label(): line.get_ydata()[0] for line in ax.lines if not str(line.get_gid()).endswith("tail")}
    assert drawn == {"dominant hand, reach": 30.0, "non-dominant hand, reach": 20.0}
    with pytest.raises(UserError, match=r"several models \(cc_s, bi_s\): draw one"):
        brl.plot_curves(pd.concat([curves, curves.assign(model="bi_s")]), by_hand=True)
