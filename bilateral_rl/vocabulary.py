"""The words of the whole toolkit, defined once: sides, parameter groups, losses, streams, penalties and their weights.

Every room may import this file, and it imports nothing but Python: it is the ground floor.

- A *side* is a hemisphere: dominant or non-dominant.
- A *parameter group* is who owns a parameter of a network: one of the two sides, or both (shared).
- A *loss* is what trains a model. It comes to one or two *streams*, each a mix of the dominant and the non-dominant
  loss (in reinforcement learning: reward) that sends its own gradients.
- A *weight penalty* is the regularization term of a stream's loss (paper section 4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Side = Literal["dominant", "non_dominant"]
SIDES: tuple[Side, Side] = ("dominant", "non_dominant")
"""The order of every pair: rewards, returns, losses, combination weights."""

Group = Literal["dominant", "non_dominant", "shared"]
GROUPS: tuple[Group, ...] = (*SIDES, "shared")
"""Every parameter of a network belongs to exactly one of these."""

Architecture = Literal["unilateral", "bilateral", "callosal"]

Loss = Literal["combined", "dominant", "non_dominant", "specialized"]
LOSSES: tuple[Loss, ...] = ("combined", "dominant", "non_dominant", "specialized")
"""What trains a model: half of both losses, one of them, or each for its own side (paper section 1)."""

_STREAM_MIX: dict[Loss, tuple[tuple[float, float], ...]] = {
    "combined": ((0.5, 0.5),),
    "dominant": ((1.0, 0.0),),
    "non_dominant": ((0.0, 1.0),),
    "specialized": ((1.0, 0.0), (0.0, 1.0)),
}

_SPECIALIZED_SHARES: dict[str, tuple[float, ...]] = {
    "dominant": (1.0, 0.0),
    "non_dominant": (0.0, 1.0),
    "shared": (0.5, 0.5),
}


@dataclass(frozen=True)
class LossWeights:
    """Weights of a step's terms, and of the weight penalty, in the loss of one side (paper section 4)."""

    cartesian_1: float
    """Weight of the mean absolute error of the hand (m)."""
    cartesian_2: float
    """Weight of ten times the mean squared error of the hand (m²)."""
    activation: float
    """Weight of the mean squared muscle excitation."""
    penalty: float
    """Weight of the weight penalty, a loss on parameters."""

    @property
    def terms(self) -> tuple[float, float, float]:
        """The weights of a step's terms, in the order in which the arm's kernels compute them."""
        return self.cartesian_1, self.cartesian_2, self.activation


LOSS_WEIGHTS: dict[Side, LossWeights] = {
    "dominant": LossWeights(cartesian_1=0.0, cartesian_2=5.0, activation=2.0, penalty=0.0),
    "non_dominant": LossWeights(cartesian_1=5.0, cartesian_2=0.0, activation=0.0, penalty=2.0),
}
"""The dominant loss rewards accuracy at little effort, the non-dominant one a steady hand and small weights."""

PENALTY_WEIGHTS: tuple[float, float] = (LOSS_WEIGHTS["dominant"].penalty, LOSS_WEIGHTS["non_dominant"].penalty)
"""Weight of the weight penalty in the dominant and in the non-dominant loss, as in the paper."""

Penalty = Literal["weights", "activity", "released"]
PENALTIES: dict[Penalty, float] = {"weights": 0.001, "activity": 0.01, "released": 0.01}
"""What the weight penalty is taken of, and its default coefficient λ.

- ``weights``: λ · ½ Σ w² over every kernel, bias and combination weight.
- ``activity``: λ · (mean x² + 0.05 · mean ẋ²) of each hidden layer's activity x.
- ``released``: the same of each of the first outputs, as many as there are hidden layers, that the paper's released
  code pairs with them by mistake: joint state, muscle state, proprioceptive and visual feedback.
"""

Profile = Literal["paper", "released"]
PROFILES: dict[Profile, Penalty] = {"paper": "weights", "released": "released"}
"""The kind of weight penalty in the paper's text and in its released code (section 4)."""

TEST_TRIALS, TEST_SEED = 1024, 2_000_000
"""Trials of a test, and the seed of the first: the same in every command and study, so that all give the same numbers.

Trial i is the first trial of seed ``TEST_SEED + i``.
"""


def path_names(n_arms: int) -> dict[str, tuple[int, Side]]:
    """Return every path from a side to an arm, as the arm's number and the side, by the name that tables and logs use.

    Of one arm that is the side's name; of two, first the arm's and then the side's: ``"dominant_arm/non_dominant"``.
    """
    if n_arms == 1:
        return {side: (0, side) for side in SIDES}
    return {f"{name}_arm/{side}": (arm, side) for arm, name in enumerate(SIDES) for side in SIDES}


def stream_mix(loss: Loss) -> tuple[tuple[float, float], ...]:
    """Return, for each stream of ``loss``, its weights of the dominant and the non-dominant loss or reward.

    Raises:
        ValueError: an unknown loss.
    """
    if loss not in _STREAM_MIX:
        raise ValueError(f"unknown loss {loss!r}; choose from {', '.join(LOSSES)}.")
    return _STREAM_MIX[loss]


def stream_names(loss: Loss) -> tuple[str, ...]:
    """Return what each stream of ``loss`` is called in logs."""
    return SIDES if loss == "specialized" else (loss,)


def stream_penalties(loss: Loss, weights: Sequence[float] = PENALTY_WEIGHTS) -> tuple[float, ...]:
    """Return the weight of the weight penalty in each stream of ``loss``.

    Args:
        loss: what trains the model.
        weights: those in the dominant and in the non-dominant loss.
    """
    return tuple(sum(m * w for m, w in zip(mix, weights, strict=True)) for mix in stream_mix(loss))


def group_shares(loss: Loss) -> dict[str, tuple[float, ...]]:
    """Return, for each parameter group, how much of each stream's gradient it gets (paper section 5)."""
    if loss == "specialized":
        return dict(_SPECIALIZED_SHARES)
    return dict.fromkeys(GROUPS, (1.0,) * len(stream_mix(loss)))


def group_penalties(
    loss: Loss, scales: Sequence[float] | None = None, weights: Sequence[float] = PENALTY_WEIGHTS
) -> dict[str, float]:
    """Return the weight of the weight penalty on each parameter group, routed like the rest of the loss.

    Args:
        loss: what trains the model.
        scales: by how much each stream's loss is scaled, and with it the penalty, which is one of its terms; None for
            losses in their own size.
        weights: weight of the penalty in the dominant and in the non-dominant loss.
    """
    streams = stream_penalties(loss, weights)
    if scales is not None:
        streams = tuple(weight * scale for weight, scale in zip(streams, scales, strict=True))
    return {
        group: sum(share * weight for share, weight in zip(shares, streams, strict=True))
        for group, shares in group_shares(loss).items()
    }
