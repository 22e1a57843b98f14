"""Two-hemisphere motor controllers on a six-muscle arm, trained with stable-baselines3.

``import bilateral_rl`` registers the environments with Gymnasium and the policies' names with SB3's PPO and A2C, so
that ``PPO("CallosalPolicy", "bilateral_rl/RandomReach-v0")`` works.
"""

from bilateral_rl import envs, policies

__version__ = "0.2.0"

__all__ = ["__version__", "envs", "policies"]
