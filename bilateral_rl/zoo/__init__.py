"""rl_zoo3 with the hemispheric algorithms: ``python -m bilateral_rl.zoo train --algo hemispheric_ppo --env …``."""

from bilateral_rl.algorithms import ALGORITHM_CLASSES, Hemispheric

ALGORITHMS: dict[str, type[Hemispheric]] = {f"hemispheric_{name}": cls for name, cls in ALGORITHM_CLASSES.items()}
"""What the zoo's ``--algo`` calls them."""

__all__ = ["ALGORITHMS"]
