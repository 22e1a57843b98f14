"""Checks of options that several commands share."""

from __future__ import annotations

from bilateral_rl.io.errors import UserError


def check_trials(trials: int, seed: int = 0) -> None:
    """Refuse a number of test trials, or a seed of the first, that cannot be.

    Raises:
        UserError: less than one trial, or a negative seed.
    """
    if trials < 1:
        raise UserError(f"--trials must be at least 1, got {trials}.")
    if seed < 0:
        raise UserError(f"--seed must be at least 0, got {seed}.")
