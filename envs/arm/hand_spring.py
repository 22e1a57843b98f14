"""The spring and the damper between two hands, and the slopes of their force, as Warp functions of either precision.

Hands are (4,), position (m) and velocity (m/s); both are in the own frame of the arm that the force is on.
"""

from typing import Any

import warp as wp


@wp.func
def seen_from_other_arm(hand: Any, shoulder_distance: Any) -> Any:
    """Return a hand of one arm's own frame in the other arm's own frame, its mirror image: the same for both arms."""
    return type(hand)(-hand[0] - shoulder_distance, hand[1], -hand[2], hand[3])


@wp.func
def vector_spring(own: Any, other: Any, rest: Any, stiffness: Any, damping: Any) -> Any:
    """Return the force (2,) (N) on the own hand of a spring that holds the vector to the other one at ``rest`` (2,)."""
    apart = type(rest)(other[0] - own[0], other[1] - own[1])
    rate = type(rest)(other[2] - own[2], other[3] - own[3])
    return stiffness * (apart - rest) + damping * rate


@wp.func
def distance_spring(own: Any, other: Any, rest: Any, stiffness: Any, damping: Any) -> Any:
    """Return the force (2,) (N) on the own hand of a spring that holds the distance alone at the length of ``rest``.

    Hands at the same place pull in no direction: there it is 0.
    """
    apart = type(rest)(other[0] - own[0], other[1] - own[1])
    rate = type(rest)(other[2] - own[2], other[3] - own[3])
    length = wp.length(apart)
    direction = wp.normalize(apart)
    return (stiffness * (length - wp.length(rest)) + damping * wp.dot(direction, rate)) * direction


@wp.func
def vector_spring_slopes(own: Any, other: Any, rest: Any, stiffness: Any, damping: Any) -> Any:
    """Return the partial derivatives (2, 2) of ``vector_spring`` by the other hand's position, and by its velocity.

    Those by the own hand are their negatives.
    """
    return wp.diag(type(rest)(stiffness, stiffness)), wp.diag(type(rest)(damping, damping))


@wp.func
def distance_spring_slopes(own: Any, other: Any, rest: Any, stiffness: Any, damping: Any) -> Any:
    """Return the partial derivatives of ``distance_spring``, likewise; 0 for hands at the same place.

    The force is a tension along the direction u from hand to hand: by what is between the hands, the tension changes by
    ``slope``, and u by what of a change is across u, over the distance.
    """
    one = type(stiffness)(1.0)
    apart = type(rest)(other[0] - own[0], other[1] - own[1])
    rate = type(rest)(other[2] - own[2], other[3] - own[3])
    length = wp.length(apart)
    u = wp.normalize(apart)
    along = wp.outer(u, u)
    inverse = wp.where(length > type(stiffness)(0.0), one / length, type(stiffness)(0.0))
    tension = stiffness * (length - wp.length(rest)) + damping * wp.dot(u, rate)
    slope = stiffness * u + damping * inverse * (rate - wp.dot(u, rate) * u)
    turn = tension * inverse  # by what of a change is across u, 1 - u uᵀ
    return wp.outer(u, slope - turn * u) + wp.diag(type(rest)(turn, turn)), damping * along
