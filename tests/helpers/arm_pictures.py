"""Pictures of one arm in one posture, and where in them something has changed."""

import numpy as np

from bilateral_rl.envs.arm.parameters import ArmParameters
from bilateral_rl.envs.arm_drawing import ArmScene
from bilateral_rl.envs.rendering import VIEW_MARGIN, Scene, draw

ARM = ArmParameters()
SIZE = 480
RADIUS = 0.05
ONE = ArmScene(
    angles=np.radians([40.0, 80.0]),
    activation=np.full(6, 0.2),
    target=np.array([-0.2, 0.4]),
    path=np.empty((0, 2)),
    load=np.zeros(2),
)


def picture(arm=ARM, threshold=RADIUS, caption="", **changes):
    """A picture of the one arm, in some things another."""
    return draw(arm, Scene((ONE._replace(**changes),), threshold, caption), SIZE)


def pixel(point):
    """(row, column) of a point in m, with the shoulder at the center and y up."""
    scale = SIZE / (2 * VIEW_MARGIN * sum(ARM.link_length))
    return round(SIZE / 2 - scale * point[1]), round(SIZE / 2 + scale * point[0])


def changed(first, second):
    """(h, w) where two pictures differ."""
    return (first != second).any(axis=-1)


def hand(angles):
    upper, fore = ARM.link_length
    return np.array(
        [
            upper * np.cos(angles[0]) + fore * np.cos(np.sum(angles)),
            upper * np.sin(angles[0]) + fore * np.sin(np.sum(angles)),
        ]
    )


def is_near(mask, point, radius):
    """Whether all of a mask lies within a radius (m) of a point."""
    row, column = pixel(point)
    rows, columns = np.nonzero(mask)
    scale = SIZE / (2 * VIEW_MARGIN * sum(ARM.link_length))
    return mask.any() and np.hypot(rows - row, columns - column).max() <= radius * scale + 2
