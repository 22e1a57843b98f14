"""stable-baselines3 algorithms that train two hemispheres, each with its own reward stream."""

from bilateral_rl.algorithms.hemispheric import Hemispheric
from bilateral_rl.algorithms.hemispheric_a2c import HemisphericA2C
from bilateral_rl.algorithms.hemispheric_ppo import HemisphericPPO
from bilateral_rl.algorithms.hemispheric_sac import HemisphericSAC
from bilateral_rl.algorithms.hemispheric_td3 import HemisphericTD3
from bilateral_rl.vocabulary import LOSSES, Loss

ALGORITHM_CLASSES: dict[str, type[Hemispheric]] = {
    "ppo": HemisphericPPO,
    "a2c": HemisphericA2C,
    "sac": HemisphericSAC,
    "td3": HemisphericTD3,
}
"""The algorithms by the name that ``--algo`` and configurations have for them."""

__all__ = [
    "ALGORITHM_CLASSES", "LOSSES", "Hemispheric", "HemisphericA2C", "HemisphericPPO", "HemisphericSAC",
    "HemisphericTD3", "Loss",
]  # fmt: skip
