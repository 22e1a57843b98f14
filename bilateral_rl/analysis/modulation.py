"""What each side of a network supplies to the muscle commands: how much it moves them, and its constant part.

Of a network of two arms, each arm's commands are looked at by themselves.
"""

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
from bilateral_rl.vocabulary import SIDES, Side, path_names

Floating = NDArray[np.floating]

SILENT_PERCENT = 5.0
"""Largest share of both sides' modulation at which a side is called silent [ours]."""
_QUANTITIES = ("contribution", "contribution_percent", "contribution_constant")
"""What logs call a side's modulation, its share of both sides' (%), and its constant part; the side follows."""


def _tags(n_arms: int) -> dict[str, str]:
    paths = path_names(n_arms)
    return {f"{quantity}_{path.replace('/', '_')}": f"{quantity}/{path}" for quantity in _QUANTITIES for path in paths}


TAGS_OF: dict[int, dict[str, str]] = {n_arms: _tags(n_arms) for n_arms in (1, 2)}
"""By the number of arms and the names of :meth:`SideModulation.measures`, as tables have them, tensorboard's names."""
TAGS = TAGS_OF[1] | TAGS_OF[2]
"""The same of any number of arms."""
_ROUNDING = 1e-6
"""What varies by less than this part of the largest contribution is taken as constant."""


class Contributions(NamedTuple):
    """What each side adds to the commands before the sigmoid, (n, T, muscles) in n trials of T steps.

    Their sum and the output layer's bias are the network's output.
    """

    dominant: Floating
    non_dominant: Floating


@dataclass(frozen=True)
class SideModulation:
    """How much each side moves the commands before the sigmoid in some trials, and what it adds to them all the time.

    A saturated side moves nothing, however much it adds. Sides that work against each other both count in full.

    Its numbers are by side; of two arms by arm and side, as ``"dominant_arm/non_dominant"`` (``path_names``).
    """

    modulation: Mapping[str, float]
    """Standard deviation of a side's contribution over time and trials, mean over the arm's muscles."""
    constant: Mapping[str, float]
    """Absolute value of the mean of a side's contribution over time and trials, mean over the arm's muscles."""

    @property
    def n_arms(self) -> int:
        """How many arms the network commands."""
        return len(self.modulation) // len(SIDES)

    @property
    def percent(self) -> dict[str, float]:
        """Each side's share of both sides' modulation of the same arm (%); NaN where neither moves anything."""
        totals = self._totals
        return {
            path: 100 * self.modulation[path] / totals[arm] if totals[arm] > 0 else float("nan")
            for path, (arm, _) in path_names(self.n_arms).items()
        }

    @property
    def silent(self) -> list[Side]:
        """The sides whose share is no larger than ``SILENT_PERCENT`` in any arm; both where neither moves anything."""
        totals, paths = self._totals, path_names(self.n_arms).items()
        silent = {path for path, (arm, _) in paths if self.modulation[path] <= SILENT_PERCENT / 100 * totals[arm]}
        return [side for side in SIDES if all(path in silent for path, (_, of) in paths if of == side)]

    @property
    def _totals(self) -> list[float]:
        """Both sides' modulation of each arm."""
        totals = [0.0] * self.n_arms
        for path, (arm, _) in path_names(self.n_arms).items():
            totals[arm] += self.modulation[path]
        return totals

    def of_arm(self, arm: int) -> SideModulation:
        """Return the same of one arm alone, by side."""
        paths: dict[str, str] = {side: path for path, (of, side) in path_names(self.n_arms).items() if of == arm}
        modulation, constant = (
            {side: values[path] for side, path in paths.items()} for values in (self.modulation, self.constant)
        )
        return SideModulation(modulation, constant)

    @classmethod
    def from_measures(cls, measures: Mapping[str, float]) -> SideModulation:
        """Return the modulation that :meth:`measures` came from."""
        n_arms = next(n for n, tags in TAGS_OF.items() if tags.keys() <= measures.keys())
        by_tag = {tag: measures[name] for name, tag in TAGS_OF[n_arms].items()}
        modulation, _, constant = (
            {path: by_tag[f"{quantity}/{path}"] for path in path_names(n_arms)} for quantity in _QUANTITIES
        )
        return cls(modulation, constant)

    def measures(self) -> dict[str, float]:
        """Return all numbers by name: ``contribution_dominant``, … (:data:`TAGS`)."""
        values = (self.modulation, self.percent, self.constant)
        paths = path_names(self.n_arms)
        return dict(zip(TAGS_OF[self.n_arms], (of_path[path] for of_path in values for path in paths), strict=True))


def side_modulation(network: MotorNetwork, record: TrialRecord) -> SideModulation | None:
    """Return what each side of ``network`` supplied in trials that it did itself, with its present lesion.

    Noise of its hidden units is left out: it would make a side that is silent seem to say something.

    Args:
        network: any network; one without sides gives None.
        record: trials that it did in its present state.
    """
    if not isinstance(network, BilateralNetwork):
        return None
    return modulation_of(contributions_in(network, record), network.n_arms)


def side_modulations(
    networks: Mapping[int, MotorNetwork], records: Mapping[int, TrialRecord]
) -> dict[int, SideModulation]:
    """Return :func:`side_modulation` of each seed's network in its trials, left out where there are no sides."""
    of_seeds = {seed: side_modulation(network, records[seed]) for seed, network in networks.items()}
    return {seed: modulation for seed, modulation in of_seeds.items() if modulation}


def contributions_in(network: BilateralNetwork, record: TrialRecord) -> Contributions:
    """Return :func:`contributions` in trials, without noise of hidden units."""
    rows = record.observation  # a row a hand: what the network sees of a trial is both hands' views side by side
    views = rows.reshape(-1, network.n_arms, *rows.shape[1:]).swapaxes(1, 2)
    return contributions(network, views.reshape(*views.shape[:2], -1))


def contributions(
    network: BilateralNetwork, observation: NDArray[np.float32], noise: torch.Tensor | None = None
) -> Contributions:
    """Return what each side of ``network``, with its present lesion, adds to the commands.

    That is the side's last hidden layer times its combination weight, through the output layer without its bias. A side
    with a deep lesion adds nothing.

    Args:
        network: any network with sides.
        observation: (n, T, n_inputs), what it sees.
        noise: (n, T, layers · sides, width), that of its hidden units; None for none.
    """
    with one_torch_thread(), torch.no_grad():
        added = network.contributions(torch.from_numpy(observation).to(network.combination_dominant), noise)
        return Contributions(*(side.cpu().numpy() for side in added))


def modulation_of(added: Contributions, n_arms: int = 1) -> SideModulation:
    """Return the modulation and the constant part of each side's contributions (n, T, muscles), arm by arm."""
    by_arm = {side: np.split(getattr(added, side), n_arms, axis=2) for side in SIDES}
    paths = {path: by_arm[side][arm] for path, (arm, side) in path_names(n_arms).items()}
    return SideModulation(
        {path: float(np.sqrt(np.square(varying(of)).mean(axis=(0, 1))).mean()) for path, of in paths.items()},
        {path: float(np.abs(of.mean(axis=(0, 1), dtype=np.float64)).mean()) for path, of in paths.items()},
    )


def varying(contribution: Floating) -> NDArray[np.float64]:
    """Return contributions (n, T, muscles) less each muscle's mean over trials and steps; rounding is taken as zero."""
    deviation = contribution - contribution.mean(axis=(0, 1), dtype=np.float64)
    return np.where(np.abs(deviation) > _ROUNDING * np.abs(contribution).max(initial=0), deviation, 0.0)
