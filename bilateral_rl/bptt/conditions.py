"""What trials, losses and senses ask of a rollout."""

from __future__ import annotations

from dataclasses import dataclass, field

from bilateral_rl.bptt.features import Features
from bilateral_rl.envs.losses import LossSettings
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.tasks import Task


@dataclass(frozen=True)
class Conditions:
    """What trials, losses and senses ask of a rollout; the paper's by default.

    Args:
        timeline: whether targets come late or jump.
        forces: whether there are forces on the hand beside a load.
        settings: how trials run: delays, losses, bounds of observations.
        hidden_noise: standard deviation of the noise on the activity of hidden units.
        n_arms: arms of a trial.
    """

    timeline: bool = False
    forces: bool = False
    settings: TrialSettings = field(default_factory=TrialSettings)
    hidden_noise: float = 0.0
    n_arms: int = 1

    @classmethod
    def of(cls, task: Task, settings: TrialSettings, hidden_noise: float) -> Conditions:
        """Return the conditions of trials of ``task``."""
        return cls(task.has_timeline, task.has_forces, settings, hidden_noise, task.n_arms)

    @property
    def losses(self) -> LossSettings:
        """The weights of the losses' terms."""
        return self.settings.losses

    @property
    def features(self) -> Features:
        """What kernels are compiled for."""
        return Features(
            timeline=self.timeline,
            forces=self.forces,
            further_losses=not self.losses.is_of_the_paper,
            senses=self.settings.noisy or any(self.settings.delays),
            hidden_noise=self.hidden_noise > 0,
            arms=self.n_arms,
            distance_spring=self.n_arms > 1 and self.settings.two_arms.spring.kind == "distance",
        )

    @property
    def delays(self) -> tuple[int, int]:
        """How far the sensed muscles and the seen hand lag behind (steps)."""
        return self.settings.delays

    @property
    def observation_bounds(self) -> tuple[list[float], list[float]]:
        """The lowest and the highest of what an arm senses, which comes first in its view: noise is kept within."""
        low, high = self.settings.observation_bounds()
        return low.tolist(), high.tolist()

    def counts_from(self, n_steps: int) -> int:
        """Return the first of ``n_steps`` steps whose error and speed of the hand count."""
        last = self.losses.last_steps
        return 0 if last is None else max(n_steps - last, 0)
