"""stable-baselines3 algorithms that train two hemispheres, each with its own reward stream."""

from bilateral_rl.algorithms.hemispheric_ppo import HemisphericPPO
from bilateral_rl.algorithms.routing import LOSSES, Loss

__all__ = ["LOSSES", "HemisphericPPO", "Loss"]
