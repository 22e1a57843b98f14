"""Lesion protocols as data: what adapts after a lesion, and by what training (paper section 6)."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from typing import Any, Literal

from pydantic.dataclasses import dataclass

from bilateral_rl.config.hyperparameters import BPTTHyperparameters, Count, Flag
from bilateral_rl.config.schema import BPTTConfig
from bilateral_rl.envs.quantities import STRICT, NotNegative, Positive
from bilateral_rl.io.errors import UserError
from bilateral_rl.vocabulary import PENALTIES, Penalty

Retrained = Literal["none", "output", "combination", "everything"]
RETRAINED: dict[Retrained, str] = {
    "none": "without retraining",
    "output": "output layer retrained",
    "combination": "output layer and combination weights retrained",
    "everything": "everything retrained",
}
"""What may adapt after a lesion, in words, in the order of tables and figures."""

_NUMBER = r"[0-9.]+(?:e[-+]?[0-9]+)?"
_NAME = re.compile(
    rf"(?P<retrain>{'|'.join(RETRAINED)})(?:-(?P<epochs>[0-9]{{1,16}})-epochs)?(?:-lr-(?P<learning_rate>{_NUMBER}))?"
    rf"(?:-penalty(?:-(?P<penalty>{'|'.join(PENALTIES)}))?(?:-(?P<penalty_coefficient>{_NUMBER}))?)?"
    r"(?P<optimizer>-continued)?(?P<trials>-training-trials)?(?P<penalize_unreached>-penalize-unreached)?"
)
_LONGEST_NAME = 200


@dataclass(frozen=True, config=STRICT)
class Protocol:
    """What follows a lesion before the network is tested.

    Raises:
        ValueError: settings of a retraining where nothing is retrained.
    """

    retrain: Retrained = "output"
    """What adapts: nothing, the output layer, that and the combination weights, or everything."""
    epochs: Count = 1
    """Epochs of the retraining, each of all its trials."""
    learning_rate: Positive | None = None
    """Adam's; None for the run's own, or the paper's (0.001) where that changed over the training."""
    penalty: Penalty | None = None
    """Kind of the weight penalty in the retraining's loss; None for the run's own."""
    penalty_coefficient: NotNegative | None = None
    """λ of the weight penalty; None for the run's own, or the usual one of another kind than the run's."""
    optimizer: Literal["fresh", "continued"] = "fresh"
    """Whether Adam begins anew, or with the moments and the step count that the training left."""
    trials: Literal["new", "training"] = "new"
    """Whether the retraining's trials are new ones, or those of the training."""
    penalize_unreached: Flag = False
    """Whether the penalty moves weights that the data loss cannot reach under the lesion."""

    def __post_init__(self) -> None:
        if self.retrain == "none" and any(getattr(self, f.name) != f.default for f in fields(self)[1:]):
            raise ValueError("retrain is none, and where nothing is retrained, nothing else can be set")

    @property
    def name(self) -> str:
        """A short name that no other protocol has; :meth:`parse` reads it."""
        penalty = [*filter(None, [self.penalty]), *_numbers(self.penalty_coefficient)]
        parts = [
            *([f"{self.epochs}-epochs"] if self.epochs != 1 else []),
            *(f"lr-{number}" for number in _numbers(self.learning_rate)),
            *(["-".join(["penalty", *penalty])] if penalty else []),
            *(["continued"] if self.optimizer == "continued" else []),
            *(["training-trials"] if self.trials == "training" else []),
            *(["penalize-unreached"] if self.penalize_unreached else []),
        ]
        return "-".join([self.retrain, *parts])

    @property
    def words(self) -> str:
        """The protocol as people read it, such as "everything retrained, 3 epochs"."""
        penalty = [*filter(None, [self.penalty]), *(f"λ = {number}" for number in _numbers(self.penalty_coefficient))]
        parts = [
            *([f"{self.epochs} epochs"] if self.epochs != 1 else []),
            *(f"learning rate {number}" for number in _numbers(self.learning_rate)),
            *([f"penalty {' '.join(penalty)}"] if penalty else []),
            *(["optimizer continued"] if self.optimizer == "continued" else []),
            *(["trials of the training"] if self.trials == "training" else []),
            *(["unreached weights penalized"] if self.penalize_unreached else []),
        ]
        return ", ".join([RETRAINED[self.retrain], *parts])

    @classmethod
    def parse(cls, name: str) -> Protocol:
        """Return the protocol of this :attr:`name`.

        Raises:
            UserError: no protocol has it.
        """
        match = _NAME.fullmatch(name) if len(name) <= _LONGEST_NAME else None
        try:
            protocol = cls(**_values(match.groupdict())) if match else None
        except ValueError:  # a number out of bounds, or not of one form
            protocol = None
        if protocol is None or protocol.name != name:
            raise UserError(f"There is no lesion protocol {name[:_LONGEST_NAME]!r}.")
        return protocol

    def resolved(self, run: BPTTConfig) -> Protocol:
        """Return the same with the numbers that are really used after a lesion of a network of ``run``.

        A rate that changed over the training gives way to the paper's, which stays the same: where it began it lets a
        network relearn in an epoch what a lesion took, and where it ended it may be 0.
        """
        if self.retrain == "none":
            return self
        penalty, coefficient = self.penalty or run.penalty, self.penalty_coefficient
        if coefficient is None:
            coefficient = run.penalty_coefficient if penalty == run.penalty else PENALTIES[penalty]
        first, last = run.bptt.learning_rate, run.bptt.final_learning_rate
        rate = self.learning_rate or (first if last in (None, first) else BPTTHyperparameters.learning_rate)
        return replace(self, learning_rate=rate, penalty=penalty, penalty_coefficient=coefficient)


DEFAULT_PROTOCOLS: tuple[Protocol, ...] = (Protocol("none"), Protocol("output"), Protocol("everything"))
"""What follows a lesion if nothing is said: no retraining, the output layer's (the paper's text), and that of all."""


def _numbers(value: float | None) -> list[str]:
    """The shortest text of a number, in a list that is empty if there is none."""
    if value is None:
        return []
    short = f"{value:g}"
    return [short if float(short) == value else repr(float(value))]


def _values(parts: dict[str, str | None]) -> dict[str, Any]:
    """The fields of a protocol from the parts of its name."""
    values: dict[str, Any] = {"retrain": parts["retrain"], "penalty": parts["penalty"]}
    if parts["epochs"]:
        values["epochs"] = int(parts["epochs"])
    for name in ("learning_rate", "penalty_coefficient"):
        if (text := parts[name]) is not None:
            values[name] = float(text)
    chosen = {"optimizer": "continued", "trials": "training", "penalize_unreached": True}
    return values | {name: value for name, value in chosen.items() if parts[name]}
