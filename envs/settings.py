"""How trials run: settings in plain Python, which can be read without anything numerical."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from bilateral_rl.envs.arm.parameters import N_MUSCLES, ArmParameters
from bilateral_rl.envs.quantities import STRICT, NotNegative, Positive, Whole
from bilateral_rl.envs.refusals import refusing_in_a_sentence

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_MAX_NORMALIZED_LENGTH = 3.0
_MAX_NORMALIZED_VELOCITY = 5.0


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class TrialSettings:
    """How trials of any task run.

    Raises:
        ValueError: an unknown name, or a number outside its range.
    """

    trial_length: Annotated[Whole, Field(ge=1, le=10_000)] = 50
    """Length of a trial (steps)."""
    threshold: Positive = 0.05
    """Radius of the goal (m)."""
    max_load: NotNegative = 10.0
    """Bound of the load on the hand (N), in the tasks that have one."""
    load: Literal["axes", "direction"] = "axes"
    """How a load is drawn: "axes", each axis uniform in ±``max_load`` (the paper's released code); "direction", a
    direction uniform over the circle and a size uniform from 0 to ``max_load`` (its text)."""
    sensory_noise: NotNegative = 0.0
    """Standard deviation of the noise on each sensed number, in that number's unit: optimal lengths, maximal
    velocities and meters."""
    motor_noise: NotNegative = 0.0
    """Standard deviation of the noise on each muscle's excitation."""
    feedback_delay: Annotated[Whole, Field(ge=0, le=10_000)] = 0
    """How far what is sensed lags behind the arm (steps); the target is seen at once."""
    arm: ArmParameters = field(default_factory=ArmParameters)
    """Physical constants."""

    @property
    def noisy(self) -> bool:
        """Whether any noise is drawn."""
        return self.sensory_noise > 0 or self.motor_noise > 0

    def observation_bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the lowest and the highest observation, (16,) each; hand and target lie within the arm's reach."""
        import numpy as np  # here alone, so that a configuration is read without it

        reach = sum(self.arm.link_length)
        high = [_MAX_NORMALIZED_LENGTH] * N_MUSCLES + [_MAX_NORMALIZED_VELOCITY] * N_MUSCLES + [reach] * 4
        low = [0.0] * N_MUSCLES + [-_MAX_NORMALIZED_VELOCITY] * N_MUSCLES + [-reach] * 4
        return np.array(low, dtype=np.float32), np.array(high, dtype=np.float32)
