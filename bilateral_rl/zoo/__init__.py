"""rl_zoo3 with the hemispheric algorithms: ``python -m bilateral_rl.zoo train --algo hemispheric_ppo --env …``."""

from bilateral_rl.algorithms import ALGORITHM_CLASSES, Hemispheric

ZOO_ALGORITHMS: dict[str, type[Hemispheric]] = {f"hemispheric_{name}": cls for name, cls in ALGORITHM_CLASSES.items()}
"""The hemispheric algorithms by the names that rl_zoo3's ``--algo`` takes."""

__all__ = ["ZOO_ALGORITHMS"]
