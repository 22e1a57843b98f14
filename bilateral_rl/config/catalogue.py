"""The seven models and the algorithms, as data (paper section 1)."""

from __future__ import annotations

from dataclasses import dataclass

from bilateral_rl.io.errors import UserError
from bilateral_rl.vocabulary import Architecture, Loss


@dataclass(frozen=True)
class ModelSpec:
    """One of the paper's models: an architecture and the loss that trains it."""

    architecture: Architecture
    loss: Loss
    description: str


MODELS: dict[str, ModelSpec] = {
    "uni_b": ModelSpec("unilateral", "combined", "one network, both losses"),
    "uni_dl": ModelSpec("unilateral", "dominant", "one network, dominant loss"),
    "uni_ndl": ModelSpec("unilateral", "non_dominant", "one network, non-dominant loss"),
    "bi_ns": ModelSpec("bilateral", "combined", "two hemispheres, not specialized"),
    "bi_s": ModelSpec("bilateral", "specialized", "two hemispheres, each with its own loss"),
    "cc_ns": ModelSpec("callosal", "combined", "two hemispheres and a callosum, not specialized"),
    "cc_s": ModelSpec("callosal", "specialized", "two hemispheres and a callosum, each side with its own loss"),
}


ALGORITHMS: dict[str, str] = {
    "ppo": "proximal policy optimization, a critic and an advantage for each hemisphere",
    "a2c": "advantage actor-critic, a critic and an advantage for each hemisphere",
    "sac": "soft actor-critic, off-policy, critics for each hemisphere",
    "td3": "twin delayed deep deterministic policy gradient, off-policy, critics for each hemisphere",
    "bptt": "supervised: back-propagation through time through the arm, as in the paper",
}


MAX_SEEDS = 1_000
"""Largest number of networks in one run, far beyond use."""


def check_choice(kind: str, name: str, choices: object) -> None:
    """Raise a UserError naming the valid choices unless ``name`` is one of them."""
    valid = [str(choice) for choice in choices]  # type: ignore[attr-defined]
    if name not in valid:
        raise UserError(f"Unknown {kind} {name!r}; choose from {', '.join(valid)}.")


def find_model(name: str) -> ModelSpec:
    """Return the model called ``name``. Raises UserError naming the valid choices."""
    check_choice("model", name, MODELS)
    return MODELS[name]


def check_names(algo: str, model: str) -> None:
    """Raise a UserError if one of the two is unknown."""
    check_choice("algorithm", algo, ALGORITHMS)
    check_choice("model", model, MODELS)
