"""The spring of pictures and records against that of the kernels."""

import numpy as np
import pytest
import warp as wp

from bilateral_rl.envs.arm import hand_spring
from bilateral_rl.envs.body_frame import vectors_between_frames
from bilateral_rl.envs.spring_forces import spring_forces, to_other_hand

APART = 0.36


@pytest.mark.parametrize("kind", ["vector", "distance"])
def test_forces_are_those_of_the_kernels_and_sum_to_zero(kind):
    rng = np.random.default_rng(0)
    hands, start = rng.normal(size=(2, 5, 2, 4))
    k, c = rng.random((2, 5))
    rest = to_other_hand(start, APART)[..., :2]
    forces = spring_forces(to_other_hand(hands, APART), rest, k, c, kind)
    np.testing.assert_allclose(vectors_between_frames(forces).sum(axis=1), 0, atol=1e-12)
    of_kernels = getattr(hand_spring, f"{kind}_spring")
    for i in range(5):
        for arm in range(2):
            own, other = (wp.vec4(*hands[i, one].tolist()) for one in (arm, 1 - arm))
            seen = hand_spring.seen_from_other_arm(other, APART)
            expected = of_kernels(own, seen, wp.vec2(*rest[i, arm].tolist()), float(k[i]), float(c[i]))
            np.testing.assert_allclose(forces[i, arm], [expected[0], expected[1]], atol=1e-5)


def test_hands_at_one_place_are_pulled_by_no_spring_of_the_distance_alone():
    here = np.array(((-APART / 2, 0.3, 1.0, 0.0), (-APART / 2, 0.3, 0.0, 1.0)))
    forces = spring_forces(to_other_hand(here, APART), np.ones((2, 2)), 50.0, 2.0, "distance")
    np.testing.assert_array_equal(forces, 0)
