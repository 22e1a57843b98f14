"""What the algorithms log of each side: returns of its reward, averages of its stream, its combination weight."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.logger import Logger
from torch import Tensor

from bilateral_rl.policies.motor_network import MotorNetwork
from bilateral_rl.vocabulary import SIDES

Log = defaultdict[str, list[Tensor]]
"""Measurements by name, an entry for each update: a number (), or one a stream (n_streams,)."""


def name_stream_returns(infos: Sequence[dict[str, Any]]) -> None:
    """Put the sides' returns where SB3 keeps episode statistics; a Monitor in between leaves them out."""
    for info in infos:
        if "episode" in info and "vector_return" in info:
            dominant, non_dominant = (float(value) for value in info["vector_return"])
            info["episode"] |= {"dominant": dominant, "non_dominant": non_dominant}


def record_stream_returns(logger: Logger, episodes: Iterable[Mapping[str, Any]]) -> None:
    """Log the mean return of each side's reward over trials, of which SB3 keeps the statistics."""
    for side in SIDES:
        returns = [episode[side] for episode in episodes if side in episode]
        if returns:
            logger.record(f"return/{side}", float(np.mean(returns)))


def record_averages(logger: Logger, log: Mapping[str, Sequence[Tensor]], streams: Sequence[str]) -> None:
    """Log averages over the updates: numbers by their name, those of (n_streams,) by their name and stream."""
    for name, values in log.items():
        average = torch.stack(list(values)).mean(dim=0).cpu()
        if average.ndim:
            for stream, value in zip(streams, average.tolist(), strict=True):
                logger.record(f"{name}/{stream}", value)
        else:
            logger.record(name, average.item())


def record_combination(logger: Logger, network: MotorNetwork) -> None:
    """Log the weight of each side's output, unless it is fixed, and so no news."""
    if network.trained_combination is not False:
        for name, weight in network.combination_weights().items():
            logger.record(f"combination/{name}", weight)
