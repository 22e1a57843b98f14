"""The noise of rollouts: normal numbers of each seed's own, a function of seed, epoch and batch."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from bilateral_rl.bptt.rollout import Rollout

Purpose = Literal["training", "validation", "retraining"]
_STREAMS: dict[Purpose, int] = {"training": 6, "validation": 7, "retraining": 8}
"""Numbers of a seed's random streams, after those of ``trials.py``."""
_SENSES_AND_MUSCLES, _HIDDEN = range(2)


def draw_noise(rollout: Rollout, seeds: Sequence[int], purpose: Purpose, epoch: int = 0, batch: int = 0) -> None:
    """Draw the noise of the rollout's next trials, if its conditions have any.

    Numbers depend on nothing but the arguments, so that a training that goes on repeats them, and so that a network has
    the noise that it would have alone. What a network does depends on them smoothly: gradients go by them as by any
    other number.

    Args:
        rollout: of ``S`` networks.
        seeds: (S,), their seeds.
        purpose: what the trials are for, each with streams of its own.
        epoch: of the training.
        batch: of the epoch.
    """
    conditions, key = rollout.conditions, (_STREAMS[purpose], epoch, batch)
    if conditions.settings.noisy:
        scale = np.asarray(conditions.settings.noise_scale, dtype=np.float32)
        _fill(rollout, rollout.noise, scale, seeds, (*key, _SENSES_AND_MUSCLES))
    if conditions.hidden_noise:
        _fill(rollout, rollout.hidden_noise, np.float32(conditions.hidden_noise), seeds, (*key, _HIDDEN))


def _fill(
    rollout: Rollout,
    noise: Tensor,
    scale: NDArray[np.float32] | np.float32,
    seeds: Sequence[int],
    key: tuple[int, ...],
) -> None:
    """Fill ``noise`` (S, …) with numbers of standard deviation ``scale``, a network's from the stream of its seed."""

    def fill(own: Tensor, seed: int) -> None:
        generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
        numbers = generator.standard_normal(own.shape, dtype=np.float32)
        own.copy_(torch.from_numpy(np.multiply(numbers, scale, out=numbers)))

    rollout.share([functools.partial(fill, own, seed) for own, seed in zip(noise, seeds, strict=True)])
