"""The weights of the terms in the losses of both sides, and so of their rewards: settings, the paper's by default."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated

from pydantic import BeforeValidator, Field
from pydantic.dataclasses import dataclass

from bilateral_rl.envs.quantities import STRICT, NotNegative, Whole
from bilateral_rl.envs.refusals import refusing_in_a_sentence
from bilateral_rl.vocabulary import LOSS_WEIGHTS, SIDES, LossWeights, Side

PAPER_TERMS = ("cartesian_1", "cartesian_2", "activation")
"""The terms of a step's loss in the paper, in the order of every array of terms."""
FURTHER_TERMS = ("hand_speed", "excitation_change", "muscle_force")
"""The terms that follow where a loss weighs any of them."""


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class SideLoss:
    """Weights of a step's terms in the loss of one side; the reward of the step is minus the weighted sum.

    A term is a mean over the steps of a trial in a loss, and a step's number in a reward.

    Raises:
        ValueError: an unknown name, or a weight that is negative or not finite.
    """

    cartesian_1: NotNegative = 0.0
    """Of the mean absolute error of the hand over x and y (m; paper section 4)."""
    cartesian_2: NotNegative = 0.0
    """Of ten times the mean squared error of the hand (m²; paper section 4)."""
    activation: NotNegative = 0.0
    """Of the mean squared excitation of the muscles (paper section 4)."""
    hand_speed: NotNegative = 0.0
    """Of the squared speed of the hand (m²/s²): a hand at rest, as the end of a reach asks for (Todorov & Jordan 2002,
    doi:10.1038/nn963)."""
    excitation_change: NotNegative = 0.0
    """Of the mean squared change of the excitations since the step before, 0 in the first: smooth commands (Uno, Kawato
    & Suzuki 1989, doi:10.1007/BF00204593, of torques)."""
    muscle_force: NotNegative = 0.0
    """Of the mean squared muscle force after the step, each over its maximal isometric one (Crowninshield & Brand 1981,
    doi:10.1016/0021-9290(81)90035-X, of stresses)."""
    penalty: NotNegative = 0.0
    """Of the weight penalty, a loss on parameters: what trains them takes it, no reward has it."""

    @property
    def terms(self) -> tuple[float, ...]:
        """The six weights of a step's terms, the paper's first."""
        return tuple(getattr(self, name) for name in (*PAPER_TERMS, *FURTHER_TERMS))


def _paper(weights: LossWeights) -> dict[str, float]:
    return {name: getattr(weights, name) for name in (*PAPER_TERMS, "penalty")}


def _over_the_paper(side: Side) -> BeforeValidator:
    """Let a mapping of weights change the paper's loss: who adds a term to it does not take the others away."""
    return BeforeValidator(lambda given: _paper(LOSS_WEIGHTS[side]) | given if isinstance(given, dict) else given)


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class LossSettings:
    """The losses of both sides, for rewards and for supervised training alike.

    A ``SideLoss`` is the whole loss of a side; a mapping of weights leaves those that it does not name as in the paper.

    Raises:
        ValueError: an unknown name, or a number outside its range.
    """

    dominant: Annotated[SideLoss, _over_the_paper("dominant")] = field(
        default_factory=lambda: SideLoss(**_paper(LOSS_WEIGHTS["dominant"]))
    )
    """The loss of the dominant side."""
    non_dominant: Annotated[SideLoss, _over_the_paper("non_dominant")] = field(
        default_factory=lambda: SideLoss(**_paper(LOSS_WEIGHTS["non_dominant"]))
    )
    """The loss of the non-dominant side."""
    last_steps: Annotated[Whole, Field(ge=1, le=10_000)] | None = None
    """Let error and speed of the hand count in so many last steps of a trial only; null for all steps."""

    @property
    def weights(self) -> tuple[tuple[float, ...], ...]:
        """The weights (2, 6) of a step's terms: dominant, then non-dominant."""
        return tuple(getattr(self, side).terms for side in SIDES)

    @property
    def penalties(self) -> tuple[float, float]:
        """The weight of the weight penalty in the dominant and in the non-dominant loss."""
        return self.dominant.penalty, self.non_dominant.penalty

    @property
    def is_of_the_paper(self) -> bool:
        """Whether the paper's three terms over all steps are all there is, with whatever weights."""
        further = slice(len(PAPER_TERMS), None)
        return self.last_steps is None and not any(any(weights[further]) for weights in self.weights)
