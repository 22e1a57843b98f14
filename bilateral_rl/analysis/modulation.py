"""What each side of a network supplies to the muscle commands: how much it moves them, and its constant part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.io.threads import one_torch_thread
from bilateral_rl.policies.motor_network import MotorNetwork
from bilateral_rl.policies.networks import BilateralNetwork
from bilateral_rl.vocabulary import SIDES, Side

Floating = NDArray[np.floating]

SILENT_PERCENT = 5.0
"""Largest share of both sides' modulation at which a side is called silent [ours]."""
_QUANTITIES = ("contribution", "contribution_percent", "contribution_constant")
"""What logs call a side's modulation, its share of both sides' (%), and its constant part; the side follows."""
TAGS = {f"{quantity}_{side}": f"{quantity}/{side}" for quantity in _QUANTITIES for side in SIDES}
"""By the names of :meth:`SideModulation.measures`, as tables have them, what tensorboard calls them."""
_ROUNDING = 1e-6
"""What varies by less than this part of the largest contribution is taken as constant."""


class Contributions(NamedTuple):
    """What each side adds to the commands before the sigmoid, (n, T, 6) in n trials of T steps.

    Their sum and the output layer's bias are the network's output.
    """

    dominant: Floating
    non_dominant: Floating


@dataclass(frozen=True)
class SideModulation:
    """How much each side moves the commands before the sigmoid in some trials, and what it adds to them all the time.

    A saturated side moves nothing, however much it adds. Sides that work against each other both count in full.
    """

    modulation: Mapping[Side, float]
    """Standard deviation of a side's contribution over time and trials, mean over the muscles."""
    constant: Mapping[Side, float]
    """Absolute value of the mean of a side's contribution over time and trials, mean over the muscles."""

    @property
    def percent(self) -> dict[Side, float]:
        """Each side's share of both sides' modulation (%); NaN where neither moves anything."""
        total = sum(self.modulation.values())
        return {side: 100 * self.modulation[side] / total if total > 0 else float("nan") for side in SIDES}

    @property
    def silent(self) -> list[Side]:
        """The sides whose share is no larger than ``SILENT_PERCENT``; both where neither moves anything."""
        largest = SILENT_PERCENT / 100 * sum(self.modulation.values())
        return [side for side in SIDES if self.modulation[side] <= largest]

    @classmethod
    def from_measures(cls, measures: Mapping[str, float]) -> SideModulation:
        """Return the modulation that :meth:`measures` came from."""
        modulation, _, constant = ({side: measures[f"{quantity}_{side}"] for side in SIDES} for quantity in _QUANTITIES)
        return cls(modulation, constant)

    def measures(self) -> dict[str, float]:
        """Return all numbers by name: ``contribution_dominant``, … (:data:`TAGS`)."""
        values = (self.modulation, self.percent, self.constant)
        return dict(zip(TAGS, (of_side[side] for of_side in values for side in SIDES), strict=True))


def side_modulation(network: MotorNetwork, record: TrialRecord) -> SideModulation | None:
    """Return what each side of ``network`` supplied in trials that it did itself, with its present lesion.

    Noise of its hidden units is left out: it would make a side that is silent seem to say something.

    Args:
        network: any network; one without sides gives None.
        record: trials that it did in its present state.
    """
    return modulation_of(contributions(network, record.observation)) if isinstance(network, BilateralNetwork) else None


def side_modulations(
    networks: Mapping[int, MotorNetwork], records: Mapping[int, TrialRecord]
) -> dict[int, SideModulation]:
    """Return :func:`side_modulation` of each seed's network in its trials, left out where there are no sides."""
    of_seeds = {seed: side_modulation(network, records[seed]) for seed, network in networks.items()}
    return {seed: modulation for seed, modulation in of_seeds.items() if modulation}


def contributions(
    network: BilateralNetwork, observation: NDArray[np.float32], noise: torch.Tensor | None = None
) -> Contributions:
    """Return what each side of ``network``, with its present lesion, adds to the commands on observations (n, T, 16).

    That is the side's last hidden layer times its combination weight, through the output layer without its bias. A side
    with a deep lesion adds nothing. With noise of hidden units, (n, T, layers · sides, width), that is in it.
    """
    with one_torch_thread(), torch.no_grad():
        added = network.contributions(torch.from_numpy(observation).to(network.combination_dominant), noise)
        return Contributions(*(side.cpu().numpy() for side in added))


def modulation_of(added: Contributions) -> SideModulation:
    """Return the modulation and the constant part of each side's contributions (n, T, 6)."""
    modulation = [np.sqrt(np.square(varying(side)).mean(axis=(0, 1))).mean() for side in added]
    constant = [np.abs(side.mean(axis=(0, 1), dtype=np.float64)).mean() for side in added]
    return SideModulation(*(dict(zip(SIDES, map(float, values), strict=True)) for values in (modulation, constant)))


def varying(contribution: Floating) -> NDArray[np.float64]:
    """Return contributions (n, T, 6) less each muscle's mean over trials and steps; rounding is taken as zero."""
    deviation = contribution - contribution.mean(axis=(0, 1), dtype=np.float64)
    return np.where(np.abs(deviation) > _ROUNDING * np.abs(contribution).max(initial=0), deviation, 0.0)
