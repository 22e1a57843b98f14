"""How a network divides over the arms that it commands: one, or two that cross to the hemispheres."""

from __future__ import annotations

from bilateral_rl.policies.quantities import finite, switch, whole
from bilateral_rl.vocabulary import SIDES, Side, path_names

UNITS_PER_ARM = 10
"""Units of a hidden layer for each arm, over both sides, by default."""
IPSILATERAL_SHARE = 0.15
"""Share of a hemisphere in the commands to the arm of its own side, by default [ours]: 10 to 15 % of the fibers of the
corticospinal tract do not cross (Nathan, Smith and Deacon 1990, doi:10.1093/brain/113.2.303)."""


OF_TWO_ARMS = (40, 12)
"""Numbers that an environment of two arms shows, and that it takes."""


def checked_arms(n_arms: object) -> int:
    """Return the number of arms.

    Raises:
        ValueError: anything but 1 and 2.
    """
    number = whole("n_arms", n_arms)
    if number > len(SIDES):
        raise ValueError(f"n_arms must be 1 or 2, got {number}.")
    return number


def arms_of_spaces(n_arms: object, n_observed: int, n_actions: int) -> int:
    """Return the number of arms of a policy, 1 where nobody says it.

    Raises:
        ValueError: anything but 1 and 2, or nothing where the numbers of the spaces are those of two arms.
    """
    if n_arms is None and (n_observed, n_actions) == OF_TWO_ARMS:
        raise ValueError(
            f"{n_observed} observed numbers and {n_actions} actions are those of two arms: give policy_kwargs n_arms=2 "
            "for a network that crosses over to both, or n_arms=1 for one that takes them for a single arm's."
        )
    return checked_arms(1 if n_arms is None else n_arms)


def each_arms(name: str, size: int, n_arms: int) -> int:
    """Return how many of ``size`` numbers are each arm's.

    Raises:
        ValueError: they do not divide evenly.
    """
    if size % n_arms:
        raise ValueError(f"{name} must be even, half for each arm, got {size}.")
    return size // n_arms


def checked_paths(
    architecture: str, sides: int, n_arms: int, ipsilateral_share: object, trained_combination: object
) -> tuple[float | None, bool | None]:
    """Return the two as numbers, with their defaults where there are two arms and sides, and None where not.

    Raises:
        ValueError: one that could not have its effect, or a share that is out of range.
    """
    if n_arms == 1 or sides == 1:
        for name, value in (("ipsilateral_share", ipsilateral_share), ("trained_combination", trained_combination)):
            if value is not None:
                reason = (
                    "is for networks that command two arms: leave it out, or give n_arms=2"
                    if n_arms == 1
                    else f"has no effect on a {architecture} network, which has no hemispheres: leave it out"
                )
                raise ValueError(f"{name} {reason}.")
        return None, None
    share = IPSILATERAL_SHARE if ipsilateral_share is None else ipsilateral_share
    share = finite("ipsilateral_share", share, 0.0, 1.0)
    trained = trained_combination is not None and switch("trained_combination", trained_combination)
    if trained and share == 0:
        raise ValueError(
            "trained_combination has nothing to weigh where ipsilateral_share is 0, and each arm follows one "
            "hemisphere alone: leave it out, or give a share above 0."
        )
    return share, trained


def crossed(side: Side, ipsilateral_share: float) -> list[float]:
    """Return the weights of a hemisphere in the commands to the dominant and to the non-dominant arm.

    The dominant hemisphere is contralateral to the dominant arm.
    """
    return [1 - ipsilateral_share if arm == side else ipsilateral_share for arm in SIDES]


def paths(n_arms: int, ipsilateral_share: float | None) -> dict[str, tuple[int, Side]]:
    """Return the paths from a side to an arm that there are, by their names in ``path_names``."""
    return {
        name: (arm, side)
        for name, (arm, side) in path_names(n_arms).items()
        if ipsilateral_share != 0 or side == SIDES[arm]
    }
