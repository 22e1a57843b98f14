"""The pictures of the arm and the window."""

import importlib.util
import sys

import numpy as np
import pytest
from arm_pictures import ARM, ONE, RADIUS, SIZE, changed, hand, is_near, picture, pixel

from bilateral_rl.envs import canvas
from bilateral_rl.envs.anatomy import Route, elbow_and_hand, moment_arms, muscle_course
from bilateral_rl.envs.arm.parameters import ArmParameters
from bilateral_rl.envs.arm_drawing import ArmScene
from bilateral_rl.envs.canvas import Window, tile
from bilateral_rl.envs.rendering import Scene, draw

pygame = pytest.importorskip("pygame")

BOTH_WAYS = ArmParameters(joint_lower_limit=(-1.0, -2.0), joint_upper_limit=(2.0, 2.0))
"""An arm whose elbow bends either way."""


@pytest.fixture(autouse=True)
def dummy_video(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


@pytest.mark.parametrize("angles", [(0.0, 0.0), (0.7, 1.4), (2.3, 2.6)])
def test_bones_and_moment_arms_are_those_of_the_posture(angles):
    arm = ArmParameters(
        link_length=(0.3, 0.25), path_quadratic_shoulder=(0.01,) * 6, path_quadratic_elbow=(-0.02,) * 6,
        path_reference_angle=(0.4, 1.1),
    )  # fmt: skip
    elbow, hand = elbow_and_hand(arm, np.array(angles))
    whole = np.sum(angles)
    np.testing.assert_allclose(elbow, 0.3 * np.array([np.cos(angles[0]), np.sin(angles[0])]), atol=1e-6)
    np.testing.assert_allclose(hand - elbow, 0.25 * np.array([np.cos(whole), np.sin(whole)]), atol=1e-6)
    expected = [
        [abs(s + 2 * 0.01 * (angles[0] - 0.4)), abs(e - 2 * 0.02 * (angles[1] - 1.1))]
        for s, e in zip(arm.path_linear_shoulder, arm.path_linear_elbow, strict=True)
    ]
    np.testing.assert_allclose(moment_arms(arm, np.array(angles)), expected, atol=1e-7)


def test_picture_is_rgb():
    for size in (64, 480, 501):
        frame = draw(ARM, Scene((ONE,), RADIUS), size)
        assert frame.shape == (size, size, 3)
        assert frame.dtype == np.uint8
        assert (frame == 255).all(axis=-1).mean() > 0.3
        frame[:] = 0  # the caller's own


def test_draws_at_the_joint_limits():
    for angles in ((0, 0), (135, 155), (0, 155), (135, 0)):
        assert changed(picture(angles=np.radians(angles)), picture()).any()


def test_equal_scenes_give_equal_pictures():
    first = picture(caption="t = 0.10 s", load=np.array([3.0, 1.0]))
    picture(angles=np.zeros(2))
    np.testing.assert_array_equal(first, picture(caption="t = 0.10 s", load=np.array([3.0, 1.0])))


def test_single_and_double_precision_draw_alike():
    single = ArmScene(*(value.astype(np.float32) if isinstance(value, np.ndarray) else value for value in ONE))
    assert changed(picture(**single._asdict()), picture()).mean() < 0.001


def test_activation_colors_its_muscle():
    for muscle in range(6):
        frames = [picture(activation=np.where(np.arange(6) == muscle, level, 0.0)) for level in (0.0, 0.5, 1.0)]
        where = changed(frames[0], frames[2])
        assert where.sum() > 60
        lightness = [frame[where].mean() for frame in frames]
        assert lightness[0] > lightness[1] > lightness[2]


def test_flexors_and_extensors_lie_on_their_sides():
    straight = np.zeros(2)
    passive = picture(angles=straight, activation=np.zeros(6))

    def mean_row(muscle):
        return np.nonzero(changed(picture(angles=straight, activation=np.eye(6)[muscle]), passive))[0].mean()

    for flexor, extensor in ((0, 1), (2, 3), (4, 5)):
        assert mean_row(flexor) < SIZE / 2 < mean_row(extensor)


def test_target_is_drawn_where_it_is():
    elsewhere = picture(target=np.array([5.0, 5.0]))
    for target in ((-0.2, 0.4), (0.45, -0.3)):
        drawn = changed(picture(target=np.array(target)), elsewhere)
        assert drawn[pixel(target)]
        assert is_near(drawn, target, RADIUS)


def test_goal_has_the_radius_of_the_threshold():
    areas = [changed(picture(threshold=r), picture(target=np.array([5.0, 5.0]))).sum() for r in (0.04, 0.08)]
    assert areas[1] / areas[0] == pytest.approx(4, rel=0.15)


def test_hand_is_where_the_posture_puts_it():
    row, column = pixel(hand(ONE.angles))
    assert changed(picture(), picture(angles=np.zeros(2)))[row - 4 : row + 5, column - 4 : column + 5].any()
    assert (picture()[row, column] > 240).all()


@pytest.mark.parametrize("angles", [(0.9, -1.4), (0.4, -0.5), (1.2, 1.7)])
def test_the_elbow_is_where_the_posture_puts_it_whichever_way_it_bends(angles):
    """One hand, two postures: a picture that knew the hand alone would show the other one half of the time."""
    frame = picture(BOTH_WAYS, angles=np.array(angles))

    def has_a_joint(point):
        row, column = pixel(point)
        ring = [frame[row + k * dy, column + k * dx] for dx, dy in ((0, 1), (1, 0), (0, -1), (-1, 0)) for k in range(9)]
        darkest = np.reshape(ring, (4, 9, 3)).max(axis=-1).min(axis=-1)
        return (darkest < 130).all() and (frame[row, column] > 240).all()

    upper = ARM.link_length[0]
    toward_hand = np.arctan2(*hand(angles)[::-1])
    mirrored = 2 * toward_hand - angles[0]
    assert has_a_joint(upper * np.array([np.cos(angles[0]), np.sin(angles[0])]))
    assert not has_a_joint(upper * np.array([np.cos(mirrored), np.sin(mirrored)]))


def test_a_flexor_runs_around_an_elbow_that_bends_backward_as_an_extensor_around_one_that_bends_forward():
    def course(side, angles):
        joints = np.stack((np.array([-0.13, 0.0]), np.zeros(2), *elbow_and_hand(ARM, np.array(angles))))
        route = Route(side, ((1, 0.5, 0.01), (2, 0.3, 0.01)), (0.1, 0.9), 0.01)
        return muscle_course(joints, route, np.array([0.03, 0.025]))

    flexor, extensor = course(1.0, (0.0, -2.0)), course(-1.0, (0.0, 2.0))
    np.testing.assert_allclose(flexor, extensor * (1, -1), atol=1e-6)
    elbow = np.array([ARM.link_length[0], 0.0])
    assert np.linalg.norm(flexor - elbow, axis=1).min() < 0.03


def test_the_workspace_of_an_elbow_that_bends_both_ways_reaches_to_the_stretched_arm():
    frame = picture(BOTH_WAYS, angles=np.array([2.0, 2.0]))
    inside, outside = [0.62 * np.array([np.cos(angle), np.sin(angle)]) for angle in (-0.3, -2.0)]
    assert frame[pixel(inside)].tolist() != [255, 255, 255] == frame[pixel(outside)].tolist()


def test_short_paths_draw():
    for length in (1, 2, 3):
        assert changed(picture(path=np.linspace((0.3, -0.3), (0.3, -0.4), length)), picture()).any() == (length > 1)


def test_longer_path_draws_more():
    path = np.linspace((0.4, -0.2), (-0.4, -0.2), 1000)
    drawn = [changed(picture(path=path[:k]), picture()).sum() for k in (0, 100, 500, 1000)]
    assert drawn[0] == 0
    assert drawn == sorted(set(drawn))


def test_path_fades_with_age():
    frame = picture(path=np.linspace((0.3, -0.3), (-0.3, -0.3), 50))
    old, new = (frame[pixel((x, -0.3))].mean() for x in (0.28, -0.28))
    assert old > new + 40


def test_load_is_an_arrow_only_if_it_is_not_zero():
    without = picture()
    np.testing.assert_array_equal(without, picture(load=np.array([-0.0, 0.0])))
    small, large = (changed(picture(load=np.array([force, 0.0])), without) for force in (2.0, 9.0))
    assert large.sum() > small.sum() > 0
    row, column = pixel(hand(ONE.angles))
    assert np.nonzero(large)[1].min() >= column  # to the right, as the force
    assert abs(np.nonzero(large)[0].mean() - row) < 8


def test_caption_is_at_the_top():
    rows = np.nonzero(changed(picture(caption="hold_position"), picture()))[0]
    assert len(rows) > 0
    assert rows.max() < SIZE // 12


def test_caption_lines_stand_one_below_the_other_from_the_same_left_edge():
    first = changed(picture(caption="reach"), picture())
    both = changed(picture(caption="reach\nreach"), picture())
    np.testing.assert_array_equal(both & first, first)
    (rows, columns), (first_rows, first_columns) = np.nonzero(both & ~first), np.nonzero(first)
    assert rows.min() > first_rows.max()
    assert rows.max() < SIZE // 8
    assert (columns.min(), columns.max()) == (first_columns.min(), first_columns.max())


def test_tile_is_near_square_and_row_by_row():
    for n, rows, columns in ((1, 1, 1), (2, 1, 2), (3, 2, 2), (4, 2, 2), (5, 2, 3)):
        grid = tile([np.full((4, 6, 3), i, dtype=np.uint8) for i in range(n)])
        assert grid.shape == (4 * rows, 6 * columns, 3)
        assert grid.dtype == np.uint8
        cells = grid[::4, ::6, 0].ravel()
        np.testing.assert_array_equal(cells, [*range(n), *[255] * (rows * columns - n)])


def test_tile_takes_the_columns_that_it_is_given():
    frames = [np.full((4, 6, 3), i, dtype=np.uint8) for i in range(5)]
    assert tile(frames[:3], columns=3).shape == (4, 18, 3)
    np.testing.assert_array_equal(tile(frames, columns=2)[::4, ::6, 0], [[0, 1], [2, 3], [4, 255]])


def test_tile_of_nothing_raises():
    with pytest.raises(ValueError, match="at least one"):
        tile([])


def test_window_opens_at_the_first_show_and_closes_twice():
    window = Window("arm", fps=1000)
    assert not pygame.display.get_init()
    window.close()
    for _ in range(2):
        window.show(picture())
    assert pygame.display.get_surface().get_size() == (SIZE, SIZE)
    assert pygame.display.get_caption()[0] == "arm"
    shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
    np.testing.assert_array_equal(shown, picture())
    window.close()
    window.close()
    assert not pygame.display.get_init()


def test_window_closed_by_hand_stays_closed():
    window = Window("arm", fps=1000)
    window.show(picture())
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    for _ in range(3):
        window.show(picture())
    assert not pygame.display.get_init()
    window.close()


def test_window_survives_another_user_of_pygame():
    first, second = Window("first", fps=1000), Window("second", fps=1000)
    first.show(picture())
    second.show(tile([picture()] * 2))
    second.close()
    first.show(picture())
    pygame.quit()
    first.show(picture(caption="again"))
    first.close()


def test_window_keeps_to_its_rate():
    window = Window("arm", fps=20)
    window.show(picture())
    start = pygame.time.get_ticks()
    window.show(picture())
    window.show(picture())
    window.close()
    assert pygame.time.get_ticks() - start >= 80


def test_large_picture_is_shrunk_to_the_screen():
    window = Window("arm", fps=1000)
    window.show(np.zeros((1200, 2400, 3), dtype=np.uint8))
    width, height = pygame.display.get_surface().get_size()
    assert width == pytest.approx(2 * height, abs=2)
    assert width <= pygame.display.get_desktop_sizes()[0][0]
    window.close()


def test_missing_pygame_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(ImportError, match="pip install pygame"):
        draw(ARM, Scene((ONE,), RADIUS))


def test_import_does_without_pygame(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    spec = importlib.util.spec_from_file_location("canvas_alone", canvas.__file__)
    spec.loader.exec_module(importlib.util.module_from_spec(spec))
