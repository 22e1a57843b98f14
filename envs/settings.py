"""How trials run: settings in plain Python, which can be read without anything numerical."""

from __future__ import annotations

import math
import numbers
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from bilateral_rl.envs.arm.parameters import N_MUSCLES, ArmParameters

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_MAX_NORMALIZED_LENGTH = 3.0
_MAX_NORMALIZED_VELOCITY = 5.0


@dataclass(frozen=True)
class TrialSettings:
    """How trials of any task run.

    Args:
        trial_length: steps in a trial.
        threshold: radius of the goal (m).
        max_load: bound of the load on the hand on each axis (N), in the tasks that have one.
        sensory_noise: standard deviation of the noise on each sensed number, in that number's unit.
        motor_noise: standard deviation of the noise on each muscle's excitation.
        feedback_delay: steps by which what is sensed lags behind the arm; the target is seen at once.
        arm: physical constants.

    Raises:
        ValueError: a number outside its range.
    """

    trial_length: int = 50
    threshold: float = 0.05
    max_load: float = 10.0
    sensory_noise: float = 0.0
    motor_noise: float = 0.0
    feedback_delay: int = 0
    arm: ArmParameters = field(default_factory=ArmParameters)

    def __post_init__(self) -> None:
        for name, least in (("trial_length", 1), ("feedback_delay", 0)):
            value = getattr(self, name)
            if not isinstance(value, numbers.Integral) or isinstance(value, bool) or value < least:
                raise ValueError(f"{name} must be a whole number of at least {least} steps, got {value!r}.")
        for name in ("threshold", "max_load", "sensory_noise", "motor_noise"):
            value = getattr(self, name)
            if not isinstance(value, numbers.Real) or isinstance(value, bool) or not 0 <= float(value) < math.inf:
                raise ValueError(f"{name} must be a finite number of at least 0, got {value!r}.")
        if not self.threshold > 0:
            raise ValueError(f"threshold must be a positive distance in m, got {self.threshold!r}.")

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
