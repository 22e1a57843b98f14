"""How trials run: settings in plain Python, which can be read without anything numerical."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from bilateral_rl.envs.arm.parameters import N_MUSCLES, ArmParameters
from bilateral_rl.envs.losses import LossSettings
from bilateral_rl.envs.quantities import STRICT, NotNegative, Positive, Whole
from bilateral_rl.envs.refusals import refusing_in_a_sentence
from bilateral_rl.envs.two_arms import TwoArmSettings

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_MAX_NORMALIZED_LENGTH = 3.0
_MAX_NORMALIZED_VELOCITY = 5.0
_OF_ITS_OWN = {
    "sensory_noise": ("length_noise", "velocity_noise", "vision_noise"),
    "feedback_delay": ("proprioception_delay", "vision_delay"),
}
"""Settings of single senses, by that which they take the place of."""


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
    length_noise: NotNegative | None = None
    """Standard deviation of the noise on sensed muscle lengths (optimal lengths); null for ``sensory_noise``."""
    velocity_noise: NotNegative | None = None
    """Standard deviation of the noise on sensed muscle velocities (maximal velocities); null for ``sensory_noise``."""
    vision_noise: NotNegative | None = None
    """Standard deviation of the noise on the seen position of the hand (m); null for ``sensory_noise``."""
    proprioception_delay: Annotated[Whole, Field(ge=0, le=10_000)] | None = None
    """Lag of the sensed muscles (steps); null for ``feedback_delay``."""
    vision_delay: Annotated[Whole, Field(ge=0, le=10_000)] | None = None
    """Lag of the seen hand (steps); null for ``feedback_delay``. The target is seen at once."""
    losses: LossSettings = field(default_factory=LossSettings)
    """Weights of the terms in the losses of both sides, and so of their rewards."""
    two_arms: TwoArmSettings = field(default_factory=TwoArmSettings)
    """What trials of two arms have beyond those of one, in the tasks that are of two."""
    arm: ArmParameters = field(default_factory=ArmParameters)
    """Physical constants, of both arms if there are two."""

    def __post_init__(self) -> None:
        for common, own in _OF_ITS_OWN.items():
            if getattr(self, common) and all(getattr(self, name) is not None for name in own):
                raise ValueError(f"{common} has no effect where {', '.join(own)} are all given: leave one out")
        last = self.losses.last_steps
        if last is not None and last > self.trial_length:
            raise ValueError(f"losses.last_steps must be at most trial_length, {self.trial_length}, got {last}")

    @property
    def noise_scale(self) -> tuple[float, ...]:
        """Standard deviations (20,) of a step's noise: of what is sensed, then of the excitations."""
        length, velocity, vision = (
            self.sensory_noise if own is None else own
            for own in (self.length_noise, self.velocity_noise, self.vision_noise)
        )
        muscles = [length] * N_MUSCLES + [velocity] * N_MUSCLES
        return (*muscles, vision, vision, *[self.motor_noise] * N_MUSCLES)

    @property
    def noisy(self) -> bool:
        """Whether any noise is drawn."""
        return any(self.noise_scale)

    @property
    def delays(self) -> tuple[int, int]:
        """How far the sensed muscles and the seen hand lag behind (steps)."""
        proprioception, vision = (
            self.feedback_delay if own is None else own for own in (self.proprioception_delay, self.vision_delay)
        )
        return proprioception, vision

    def observation_bounds(self, n_arms: int = 1) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the lowest and the highest observation: (16,) each, or (40,) of two arms, the dominant one first.

        Hand and target lie within their arm's reach; x of the other arm's is seen mirrored, from its shoulder on.
        """
        import numpy as np  # here alone, so that a configuration is read without it

        reach, apart = np.float32(sum(self.arm.link_length)), np.float32(self.two_arms.shoulder_distance)
        own, other = (
            [reach, reach],
            [reach - apart, reach],
        )  # in single precision, in which the other arm's are mirrored
        below = [-reach - apart, -reach]
        most, least = (own * 2, [-reach] * 4) if n_arms == 1 else ((own + other) * 2, ([-reach] * 2 + below) * 2)
        high = [_MAX_NORMALIZED_LENGTH] * N_MUSCLES + [_MAX_NORMALIZED_VELOCITY] * N_MUSCLES + most
        low = [0.0] * N_MUSCLES + [-_MAX_NORMALIZED_VELOCITY] * N_MUSCLES + least
        return np.array(low * n_arms, dtype=np.float32), np.array(high * n_arms, dtype=np.float32)
