"""Arguments of SB3's policies that ours have no use for: refused with the words of ours that do the same."""

from __future__ import annotations

from typing import Any

_NO_SDE = "there is no state-dependent exploration (gSDE)"
NOT_AVAILABLE: dict[str, tuple[object, str]] = {
    "net_arch": (None, "the network is sized by units and layers, and the critics by critic_arch"),
    "activation_fn": (
        None,
        "the network's hidden units are tanh, as in the paper, and those of the critics what critic_activation_fn says",
    ),
    "ortho_init": (None, "the network begins with Glorot-uniform kernels, as in the paper"),
    "squash_output": (True, "actions are always squashed into the bounds of the action space"),
    "use_sde": (False, _NO_SDE),
    "full_std": (True, _NO_SDE),
    "use_expln": (False, _NO_SDE),
    "clip_mean": (2.0, _NO_SDE),
}
"""Each with the one value that says no more than what is so anyway, and with what is so."""


def available(arguments: dict[str, Any]) -> dict[str, Any]:
    """Return further arguments of a policy without those of SB3's that say nothing.

    Raises:
        ValueError: one that could not have its effect.
    """
    for name, (harmless, reason) in NOT_AVAILABLE.items():
        if (value := arguments.get(name, harmless)) != harmless:
            raise ValueError(f"{name}={_shown(value)} is not available for this policy: {reason}.")
    return {name: value for name, value in arguments.items() if name not in NOT_AVAILABLE}


def _shown(value: object) -> str:
    return value.__name__ if isinstance(value, type) else repr(value)
