"""What of trials, losses and senses a rollout's kernels are compiled for."""

from __future__ import annotations

from typing import NamedTuple


class Features(NamedTuple):
    """What rollouts do beyond the paper's; every set has kernels of its own, compiled when they are first used."""

    timeline: bool = False
    """Targets that come late or jump."""
    forces: bool = False
    """Forces on the hand beside a constant load."""
    further_losses: bool = False
    """Six terms of a step's loss instead of the paper's three, and errors that count in the last steps only."""
    senses: bool = False
    """Noise of senses and muscles, and delays."""
    hidden_noise: bool = False
    """Noise on the activity of hidden units."""
    arms: int = 1
    """Arms of a trial; two are tied by a spring, maybe one of no stiffness."""
    distance_spring: bool = False
    """A spring that holds the distance of the hands alone, instead of the vector between them."""


PLAIN = Features()
"""What the paper's tasks take."""
