"""Policies whose actions are given."""

from types import SimpleNamespace
from typing import Any

from bilateral_rl.policies.hidden_noise import HiddenNoise


def acting(action: Any) -> Any:
    """A policy that does the same at every step; its network has no noise of its own."""
    network = SimpleNamespace(noise=HiddenNoise(0.0, (1, 1)))
    return SimpleNamespace(predict=lambda observation, deterministic: (action, None), motor_network=network)
