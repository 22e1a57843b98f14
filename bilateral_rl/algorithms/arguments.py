"""What the arguments of the algorithms may be, wherever they come from: a constructor, ``load``, or an attribute.

SB3 takes whatever it is given, and says so later or never: a discount of 99 is a loss that grows without bound.
"""

from __future__ import annotations

import contextlib
import functools
import inspect
import math
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any

from stable_baselines3.common.noise import ActionNoise
from stable_baselines3.common.type_aliases import TrainFreq

from bilateral_rl.policies.quantities import finite, switch, whole
from bilateral_rl.vocabulary import GROUPS, SIDES, Group

Check = Callable[[str, Any], Any]
"""Takes the name and the value of an argument, and returns it as the algorithms use it, or raises a ValueError."""


def checked(values: Mapping[str, Any], checks: Mapping[str, Check]) -> dict[str, Any]:
    """Return arguments with numbers as Python's.

    Args:
        values: arguments or attributes by name.
        checks: those of an algorithm; what has none is left as it is.

    Raises:
        ValueError: a value that cannot work, in a sentence that names it.
    """
    return {name: checks[name](name, value) if name in checks else value for name, value in values.items()}


def arguments_of_load(cls: type, changes: Mapping[str, Any], attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return what ``cls.load(path, **changes)`` shall change, by the names of attributes.

    SB3 makes an attribute of whatever it is given, also of a misspelt name.

    Args:
        cls: the algorithm.
        changes: as given.
        attributes: those of any model of it.

    Raises:
        ValueError: a name that is neither an argument of the constructor nor an attribute, or a policy.
    """
    arguments = set(inspect.signature(cls).parameters) - {"policy", "env", "device", "_init_setup_model"}
    if "policy" in changes:
        raise ValueError("a saved model keeps its policy: leave policy out of load().")
    if unknown := sorted(set(changes) - arguments - set(attributes) - {"lr_schedule"}):
        raise ValueError(
            f"load() has no argument {unknown[0]!r}; it takes those of {cls.__name__}: {', '.join(sorted(arguments))}."
        )
    return {{"stats_window_size": "_stats_window_size"}.get(name, name): value for name, value in changes.items()}


def _or_none(check: Check) -> Check:
    return lambda name, value: None if value is None else check(name, value)


def _schedule(name: str, value: Any, *, above: bool = False) -> Any:
    """Take a number of at least 0, or above it, or a function of the remaining progress."""
    return value if callable(value) else finite(name, value, 0, above=above)


def _temperature(name: str, value: Any) -> Any:
    """Take a number, "auto", or "auto_" with the number that a learned one begins with."""
    if not isinstance(value, str):
        return finite(name, value, 0)
    number = math.nan
    with contextlib.suppress(ValueError):
        number = float(value.removeprefix("auto_"))
    if value == "auto" or 0 < number < math.inf:
        return value
    raise ValueError(f'{name} must be a number, "auto", or "auto_" with a number above 0, got {value!r}.')


def _target_entropy(name: str, value: Any) -> Any:
    return value if value == "auto" else finite(name, value)


def _train_freq(name: str, value: Any) -> Any:
    """Take a number of steps, or a pair of a number and a unit, which may be a list."""
    if isinstance(value, TrainFreq):
        return value
    if isinstance(value, (tuple, list)):
        if len(value) != 2:
            raise ValueError(f'{name} must be a number of steps or a pair like (2, "episode"), got {value!r}.')
        return whole(f"the number in {name}", value[0]), value[1]
    return whole(name, value)


def _noise(name: str, value: Any) -> Any:
    if value is not None and not isinstance(value, ActionNoise):
        raise ValueError(f"{name} must be an ActionNoise of SB3, such as NormalActionNoise, or None, got {value!r}.")
    return value


def _frozen(name: str, value: Any) -> tuple[Group, ...]:
    """Take names of parameter groups, or one of them."""
    groups = (value,) if isinstance(value, str) else tuple(value) if isinstance(value, Collection) else (value,)
    if unknown := [group for group in groups if group not in GROUPS]:
        raise ValueError(f"{name} takes names of parameter groups, {', '.join(GROUPS)}, not {unknown[0]!r}.")
    return groups


def _penalty_weights(name: str, value: Any) -> tuple[float, float]:
    """Take two numbers of at least 0: dominant, non-dominant."""
    pair = list(value) if isinstance(value, Iterable) and not isinstance(value, str) else [value]
    if len(pair) != len(SIDES):
        raise ValueError(f"{name} takes two numbers, of the dominant and the non-dominant loss, got {value!r}.")
    dominant, non_dominant = (finite(f"each number of {name}", weight, 0.0) for weight in pair)
    return dominant, non_dominant


_share = functools.partial(finite, least=0.0, most=1.0)
_not_negative = functools.partial(finite, least=0.0)
_positive = functools.partial(finite, least=0.0, above=True)
_count_or_none = functools.partial(whole, least=0)

EVERY: dict[str, Check] = {
    "weight_penalty": _not_negative,
    "frozen": _frozen,
    "penalty_weights": _penalty_weights,
    "reward_scale": _positive,
    "critic_rate_factor": _positive,
    "network_epsilon": _or_none(_positive),
    "learning_rate": _schedule,
    "gamma": _share,
    "stats_window_size": whole,
    "seed": _or_none(_count_or_none),
}
"""The checks of every algorithm."""
ON_POLICY: dict[str, Check] = EVERY | {
    "n_steps": whole,
    "batch_size": whole,
    "n_epochs": whole,
    "gae_lambda": _share,
    "clip_range": functools.partial(_schedule, above=True),
    "clip_range_vf": _or_none(functools.partial(_schedule, above=True)),
    "ent_coef": _schedule,
    "vf_coef": _not_negative,
    "max_grad_norm": _positive,
    "normalize_advantage": switch,
    "target_kl": _or_none(_not_negative),
    "rms_prop_eps": _not_negative,
    "use_rms_prop": switch,
}
"""Those of PPO and A2C."""
OFF_POLICY: dict[str, Check] = EVERY | {
    "critic_warm_up": _count_or_none,
    "standardize_inputs": switch,
    "normalize_streams": switch,
    "buffer_size": whole,
    "learning_starts": _count_or_none,
    "batch_size": whole,
    "tau": _share,
    "train_freq": _train_freq,
    "gradient_steps": functools.partial(whole, least=-1),
    "action_noise": _noise,
    "ent_coef": _temperature,
    "target_update_interval": whole,
    "target_entropy": _target_entropy,
    "policy_delay": whole,
    "target_policy_noise": _not_negative,
    "target_noise_clip": _not_negative,
}
"""Those of SAC and TD3."""
