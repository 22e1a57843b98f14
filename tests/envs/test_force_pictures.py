"""What pictures show of forces on the hand, cues and jumps."""

import numpy as np
import pytest
from arm_pictures import ARM, ONE, RADIUS, SIZE, changed, hand, is_near, picture, pixel
from rich_tasks import Fixed, no_forces

from bilateral_rl.envs import ArmEnv
from bilateral_rl.envs.arm.physics import ACTIVATION
from bilateral_rl.envs.arm_drawing import ArmScene, CueScene
from bilateral_rl.envs.force_drawing import HandForceScene
from bilateral_rl.envs.rendering import VIEW_MARGIN, Scene, draw
from bilateral_rl.envs.tasks import NEVER, Timeline

pytest.importorskip("pygame")

CURL = np.array([[0.0, 15.0], [-15.0, 0.0]])
STILL = HandForceScene(np.zeros(2), np.zeros(2), np.zeros((2, 2)), np.zeros((2, 2)))
"""Forces that do nothing at the moment."""


def in_channel(angle, point, stiffness=1000.0):
    """Forces in a channel along a direction (rad) through a point (m)."""
    across = np.array((-np.sin(angle), np.cos(angle)))
    walls = stiffness * np.outer(across, across)
    return STILL._replace(offset=walls @ point, position_gain=walls, velocity_gain=-0.05 * walls)


def test_a_force_is_an_arrow_from_the_hand_with_a_legend():
    still = picture(forces=STILL)
    small, large = (changed(picture(forces=STILL._replace(force=np.array((f, 0.0)))), still) for f in (-2.0, -9.0))
    assert large.sum() > small.sum() > 0
    assert np.nonzero(large)[1].max() <= pixel(hand(ONE.angles))[1]
    legend = changed(still, picture())
    assert np.nonzero(legend)[0].min() > 0.85 * SIZE  # below the arm
    assert np.ptp(np.nonzero(legend)[1]) == pytest.approx(0.1 * SIZE / (2 * VIEW_MARGIN * sum(ARM.link_length)), abs=3)


@pytest.mark.parametrize("direction", [(1, 0), (-1, 0), (0, 1), (0, -1), (0.6, -0.8)])
def test_an_arrow_ends_within_the_picture_however_strong_the_force(direction):
    tip = changed(picture(forces=STILL._replace(force=1000.0 * np.array(direction))), picture(forces=STILL))
    rows, columns = np.nonzero(tip)
    assert min(rows.min(), columns.min()) > 0
    assert max(rows.max(), columns.max()) < SIZE - 1
    nearest = min(rows.min(), columns.min(), SIZE - 1 - rows.max(), SIZE - 1 - columns.max())
    assert nearest < 0.03 * SIZE


def test_a_channel_is_two_lines_along_its_axis_wherever_it_lies():
    for angle, point in ((0.0, (0.2, 0.4)), (1.0, (-0.1, 0.3)), (np.pi / 2, (-0.2, 0.5))):
        forces = in_channel(angle, np.array(point))
        on_axis, along = forces.channel()
        assert abs(along @ (np.cos(angle), np.sin(angle))) == pytest.approx(1)
        across = np.array((-np.sin(angle), np.cos(angle)))
        assert across @ (on_axis - point) == pytest.approx(0, abs=1e-6)
        walls = changed(picture(forces=forces), picture(forces=STILL))
        places = [on_axis + x * np.array((np.cos(angle), np.sin(angle))) for x in np.linspace(-0.7, 0.7, 29)]
        within = [np.linalg.norm(place) < sum(ARM.link_length) for place in places]
        drawn = [walls[row - 6 : row + 7, column - 6 : column + 7].any() for row, column in map(pixel, places)]
        assert sum(np.equal(drawn, within)) >= 26  # the arm may lie above
    assert STILL.channel() is None
    assert STILL._replace(position_gain=50 * np.eye(2), offset=np.ones(2)).channel() is None
    assert STILL._replace(position_gain=np.array([[30.0, 5.0], [-5.0, 20.0]])).channel() is None


def test_a_field_is_drawn_around_the_hand_or_in_the_corner_by_what_it_depends_on():
    elastic = changed(picture(forces=STILL._replace(position_gain=50 * np.eye(2))), picture(forces=STILL))
    assert is_near(elastic, hand(ONE.angles), 0.25)
    by_velocity = changed(picture(forces=STILL._replace(velocity_gain=CURL)), picture(forces=STILL))
    assert np.nonzero(by_velocity)[0].min() > SIZE / 2
    assert np.nonzero(by_velocity)[1].max() < SIZE / 4
    assert changed(
        picture(forces=STILL._replace(velocity_gain=CURL)), picture(forces=STILL._replace(velocity_gain=-CURL))
    ).any()


def test_cues_show_a_signal_and_the_target_that_is_to_come_or_was():
    goal = np.array((0.1, -0.3))
    phases = [CueScene.at(step, 3, 6, goal) for step in range(8)]
    assert [cue.phase for cue in phases] == ["wait"] * 3 + ["go"] * 3 + ["jump"] * 2
    assert [cue.other_target is None for cue in phases] == [False] * 3 + [True] * 3 + [False] * 2
    assert CueScene.at(40, NEVER, NEVER, goal).other_target is None  # a target that never comes
    for cue in (phases[0], phases[-1]):
        drawn = changed(picture(cue=cue), picture(cue=cue._replace(other_target=None)))
        assert is_near(drawn, goal, RADIUS + 0.01)
    signals = [picture(cue=CueScene(phase, None)) for phase in ("wait", "go", "jump")]
    for first, second in ((0, 1), (0, 2), (1, 2)):
        assert np.nonzero(changed(signals[first], signals[second]))[0].min() > 0.9 * SIZE


def test_an_environment_draws_its_forces_and_cues():
    goal = (1.0, 1.4)
    forces = no_forces(velocity_gain=CURL, pulse=(0.0, 8.0), pulse_window=(0, 2))
    task = Fixed(goal=goal, load=(3.0, 0.0), timeline=Timeline(2, NEVER, goal), forces=forces)
    env = ArmEnv(task, render_mode="rgb_array")
    env.reset(seed=0)
    env.step(np.full(6, -1.0))
    (shown,) = env._view.pictures()
    batch = env.batch
    scene = ArmScene(
        angles=batch.joint[0, :2],
        activation=batch.muscle[0, ACTIVATION],
        target=hand(task.start),
        path=np.stack((hand(task.start), batch.hand[0])),
        load=np.array((3.0, 0.0)),
        forces=HandForceScene(np.array((0.0, 8.0)), np.zeros(2), CURL, np.zeros((2, 2))),
        cue=CueScene("wait", hand(goal)),
    )
    assert changed(shown, draw(ARM, Scene((scene,), 0.05), 480)).mean() < 0.001


def test_a_plain_task_draws_what_it_drew():
    env = ArmEnv("hold_position", render_mode="rgb_array")
    env.reset(seed=0)
    batch = env.batch
    scene = ArmScene(
        angles=batch.joint[0, :2],
        activation=batch.muscle[0, ACTIVATION],
        target=batch.target[0],
        path=batch.hand[:1],
        load=batch.load[0],
    )
    np.testing.assert_array_equal(env.render(), draw(ARM, Scene((scene,), 0.05), 480))
