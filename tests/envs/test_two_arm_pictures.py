"""What pictures of two arms show: each arm in its place, which hand is which, and the spring between them."""

import numpy as np
import pytest
from arm_pictures import ARM, ONE, RADIUS, changed, hand

from bilateral_rl.envs import ArmEnv, ArmVectorEnv
from bilateral_rl.envs.arm.physics import ACTIVATION
from bilateral_rl.envs.arm_drawing import OF_TWO, ArmScene
from bilateral_rl.envs.body_frame import in_body_frame
from bilateral_rl.envs.canvas import Canvas, View
from bilateral_rl.envs.force_drawing import HandForceScene
from bilateral_rl.envs.rendering import Scene, draw, picture_size
from bilateral_rl.envs.spring_drawing import SPRING, SpringScene, coil

pytest.importorskip("pygame")

APART, HEIGHT = 0.36, 480
POSTURES = np.radians([(60.0, 95.0), (35.0, 80.0)])
BLUE, OCHRE = (look.hand for look in OF_TWO)


def two(postures=POSTURES, roles=("reach", "hold"), spring=None, height=HEIGHT, **changes):
    """A picture of two arms; changes are pairs, the dominant arm's value first."""
    arms = [ONE._replace(angles=angles, role=role) for angles, role in zip(postures, roles, strict=True)]
    for name, pair in changes.items():
        arms = [one._replace(**{name: value}) for one, value in zip(arms, pair, strict=True)]
    return draw(ARM, Scene(tuple(arms), RADIUS, "", APART, spring), height)


def places(color, frame):
    """(rows, columns) of the pixels that have a color."""
    return np.nonzero((frame == color).all(axis=-1))


def meters(rows, columns, frame):
    """Positions (n, 2) in the frame of the body, as a picture of the whole has them."""
    reach = sum(ARM.link_length)
    half_width = APART / 2 + reach + 0.02
    scale = frame.shape[1] / (2 * half_width)
    return np.stack([(columns + 0.5) / scale - half_width, reach + 0.115 - (rows + 0.5) / scale], axis=-1)


def test_each_hand_is_where_it_is_in_the_frame_of_the_body_and_has_its_color():
    frame = two()
    hands = in_body_frame(np.stack([hand(angles) for angles in POSTURES]), APART)
    for color, expected in zip((BLUE, OCHRE), hands, strict=True):
        found = meters(*places(color, frame), frame)
        is_near = np.linalg.norm(found - expected, axis=1) < 0.02
        np.testing.assert_allclose(found[is_near].mean(axis=0), expected, atol=0.004)


def test_arms_that_are_exchanged_are_mirrored():
    postures, activation = POSTURES, (np.eye(6)[0], np.eye(6)[4])
    first = two(postures, ("reach", "reach"), activation=activation)
    second = two(postures[::-1], ("reach", "reach"), activation=activation[::-1])
    deep_red = [(frame == (103, 0, 13)).all(axis=-1) for frame in (first, second[:, ::-1])]
    assert deep_red[0].sum() > 150
    assert np.logical_xor(*deep_red).sum() < 0.15 * deep_red[0].sum()


@pytest.mark.parametrize("role", ["reach", "hold"])
@pytest.mark.parametrize("arm", [0, 1])
def test_a_target_has_the_color_of_its_hand(arm, role):
    away = np.array((5.0, 5.0))
    targets = [away, away]
    targets[arm] = np.array((0.2, 0.35))
    frame = two(roles=(role, role), target=targets)
    found = meters(*np.nonzero(changed(frame, two(roles=(role, role), target=(away, away)))), frame)
    x = 0.38 if arm == 0 else -0.38
    np.testing.assert_allclose((found.min(axis=0) + found.max(axis=0)) / 2, (x, 0.35), atol=0.004)
    assert len(places(OF_TWO[arm].goal_fill, frame)[0]) > 200


def test_the_target_of_a_hold_has_rings_where_that_of_a_reach_has_a_cross():
    target = np.array((0.2, 0.35))
    reach, hold = (two(roles=(role, role), target=(target, target)) for role in ("reach", "hold"))
    at = np.stack(np.meshgrid(*(np.arange(n) for n in reach.shape[:2]), indexing="ij"), axis=-1)
    distance = np.linalg.norm(meters(at[..., 0], at[..., 1], reach) - (0.38, 0.35), axis=-1)
    is_blue = [frame[..., 0] < 160 for frame in (reach, hold)]  # and not the pale fill
    for radius in (0.7 * RADIUS, 0.4 * RADIUS):
        on_ring = np.abs(distance - radius) < 0.002
        assert is_blue[1][on_ring].mean() > 0.15 > 0.02 > is_blue[0][on_ring].mean()
    assert is_blue[0][distance < 0.003].any()
    assert not is_blue[1][distance < 0.003].any()


def test_words_lie_below_all_places_that_a_hand_can_take():
    postures = [np.array(q) for q in ((0.0, 0.0), (0.0, 2.7), (2.35, 0.0), (2.35, 2.7))]
    bare, written = (two(roles=roles) for roles in ((None, None), ("reach", "hold")))
    words = changed(bare, written)
    words[: HEIGHT // 2] = False  # the rings of a hold's target
    for posture in postures:
        arms = changed(two((posture, posture), (None, None)), bare)
        assert not (arms & words).any()


def test_a_picture_of_two_arms_is_broad_and_even():
    for height in (320, 480, 502):
        width, same = picture_size(ARM, 2, APART, height)
        assert (same, width % 2) == (height, 0)
        assert 1.3 < width / height < 1.6
        assert two(height=height).shape == (height, width, 3)
    assert picture_size(ARM, 1, 0.0, 481) == (481, 481)


def test_a_frame_of_a_canvas_is_mirrored_about_its_origin():
    canvas = Canvas(View((0.1, 0.2), (0.8, 0.6)), 120)
    framed = canvas.frame(-0.18, -1.0)
    np.testing.assert_allclose(framed.outside((0.3, 0.2)), (-0.48, 0.2))
    np.testing.assert_allclose(framed.inside(framed.outside((0.3, 0.2))), (0.3, 0.2))
    base, along = np.array((0.1, 0.1)), np.array((1.0, 0.0))
    assert framed.room(base, along, 0.02) == pytest.approx(-0.18 - 0.1 + 0.7 - 0.02)
    assert canvas.room(base, along, 0.02) == pytest.approx(0.9 - 0.1 - 0.02)
    assert canvas.room(base, np.array((0.6, -0.8)), 0.0) == pytest.approx(0.5 / 0.8)


def turns(wire):
    """How often a wire along x crosses its axis upward."""
    y = wire[1:-1, 1]
    return int(((y[:-1] < 0) & (y[1:] >= 0)).sum())


def test_a_coil_that_is_stretched_keeps_its_turns_which_open_and_narrow():
    lengths = (0.1, 0.2, 0.4)
    wires = [coil(np.zeros(2), np.array((length, 0.0)), start_length=0.2) for length in lengths]
    assert len({turns(wire) for wire in wires}) == 1
    heights = [np.ptp(wire[:, 1]) for wire in wires]
    assert heights[0] > heights[1] > heights[2] > 0.01
    for wire, length in zip(wires, lengths, strict=True):
        assert wire[:, 0].min() > 0
        assert wire[:, 0].max() < length
    assert np.isfinite(coil(np.zeros(2), np.zeros(2), 0.2)).all()


def test_a_turned_coil_is_the_same_coil():
    angle = 2.0
    turn = np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))))
    straight = coil(np.zeros(2), np.array((0.25, 0.0)), 0.2)
    np.testing.assert_allclose(coil(np.zeros(2), turn @ (0.25, 0.0), 0.2), straight @ turn.T, atol=1e-12)


def test_a_spring_pulls_both_hands_in_opposite_directions_and_its_force_is_written():
    still, pulled = (two(spring=SpringScene(0.2, np.array(force))) for force in ((0.0, 0.0), (0.0, -8.0)))
    assert len(places(SPRING, still)[0]) > 50
    arrows = changed(still, pulled)
    found = meters(*np.nonzero(arrows), still)
    for at, sign in zip(in_body_frame(np.stack([hand(angles) for angles in POSTURES]), APART), (-1, 1), strict=True):
        near = found[np.linalg.norm(found - at, axis=1) < 0.13]
        assert np.mean(near[:, 1] - at[1]) * sign > 0.02
    assert (found[:, 1] < -0.15).any()  # the number below


def test_forces_of_the_non_dominant_hand_are_drawn_mirrored():
    zero = np.zeros((2, 2))
    still = HandForceScene(np.zeros(2), np.zeros(2), zero, zero)
    pushed = still._replace(force=np.array((9.0, 0.0)))  # away from the midline, in its own frame
    for forces, x in (((pushed, still), 1), ((still, pushed), -1)):
        frame = two(forces=forces)
        columns = np.nonzero(changed(frame, two(forces=(still, still))))[1]
        at = in_body_frame(np.stack([hand(angles) for angles in POSTURES]), APART)[0 if x > 0 else 1, 0]
        middle = frame.shape[1] / 2 + at * frame.shape[1] / (2 * (APART / 2 + sum(ARM.link_length) + 0.02))
        assert x * (columns.mean() - middle) > 10


def test_an_environment_draws_both_hands_in_their_roles_and_the_spring():
    env = ArmEnv("reach_and_hold", render_mode="rgb_array")
    env.reset(seed=0)
    start = env.batch.hand.copy()
    for _ in range(8):
        env.step(np.resize([0.5, -1.0], 12))
    batch, (picture,) = env.batch, env._view.pictures()
    roles = ["hold" if np.array_equal(goal, at) else "reach" for goal, at in zip(batch.target, start, strict=True)]
    assert sorted(roles) == ["hold", "reach"]
    at_start, now = (in_body_frame(hands, APART) for hands in (start, batch.hand))
    force = 50 * ((now[1] - now[0]) - (at_start[1] - at_start[0]))
    assert np.linalg.norm(force) > 0.1
    arms = tuple(
        ArmScene(
            angles=batch.joint[row, :2],
            activation=batch.muscle[row, ACTIVATION],
            target=batch.target[row],
            path=np.stack(env._view._paths[0])[:, row],
            load=np.zeros(2),
            role=roles[row],
        )
        for row in range(2)
    )
    spring = SpringScene(float(np.linalg.norm(at_start[1] - at_start[0])), force)
    expected = draw(ARM, Scene(arms, 0.05, "", APART, spring), 480)
    assert changed(picture, expected).mean() < 0.001
    assert changed(picture, draw(ARM, Scene(arms, 0.05, "", APART), 480)).mean() > 0.002


def test_a_vectorized_environment_draws_a_picture_a_trial():
    env = ArmVectorEnv(2, "reach_and_hold", render_mode="rgb_array", two_arms={"spring": {"stiffness": 0.0}})
    env.reset(seed=0)
    pictures = env.render()
    assert len(pictures) == 2
    assert changed(*pictures).any()
    assert all(len(places(SPRING, picture)[0]) < 20 for picture in pictures)
