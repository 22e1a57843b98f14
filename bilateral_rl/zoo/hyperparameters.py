"""Hyperparameters for rl_zoo3, made from the tuned ones in ``bilateral_rl/config/defaults.yaml``."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

from bilateral_rl.algorithms import ALGORITHM_CLASSES
from bilateral_rl.algorithms.schedules import linear_schedule
from bilateral_rl.config.hyperparameters import TD3Hyperparameters
from bilateral_rl.config.parse import plain
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import RLConfig
from bilateral_rl.envs import ENVIRONMENT_IDS
from bilateral_rl.runs.policies import policy_arguments
from bilateral_rl.training.build import algorithm_arguments
from bilateral_rl.zoo import ZOO_ALGORITHMS

POLICY = "CallosalPolicy"
_LINEAR = "lin_"
_ONLY_HEMISPHERIC = frozenset(
    {
        "loss", "weight_penalty", "penalty_weights", "frozen", "reward_scale", "critic_warm_up", "action_traces",
        "standardize_inputs", "actor_value", "normalize_streams", "critic_rate_factor", "network_epsilon",
    }
)  # fmt: skip
"""Arguments that stock algorithms do not take."""


class _TunedModule(ModuleType):
    """What rl_zoo3's ``config`` can name: a module with the attribute ``hyperparams``.

    A module in ``sys.modules`` rather than one file per algorithm, because rl_zoo3 writes into the dictionary that it
    is given: every experiment needs a fresh one.
    """

    def __init__(self, name: str, algo: str) -> None:
        super().__init__(name)
        self._algo = algo

    @property
    def hyperparams(self) -> dict[str, dict[str, Any]]:
        return hyperparameters(self._algo)


def tuned_module(algo: str, env_id: str) -> str | None:
    """The name of the module with our hyperparameters of ``algo`` for ``env_id``; None to leave it to rl_zoo3's own."""
    is_tuned = env_id in ENVIRONMENT_IDS.values() and algo.removeprefix("hemispheric_") in ALGORITHM_CLASSES
    if algo not in ZOO_ALGORITHMS and not is_tuned:
        return None
    name = f"{__name__}.{algo}"
    sys.modules[name] = _TunedModule(name, algo)
    return name


def parse_schedule(text: str) -> linear_schedule | None:
    """The linear schedule that ``lin_A`` (from A to 0) or ``lin_A_B`` (from A to B) names; None for any other text."""
    if not text.startswith(_LINEAR):
        return None
    initial, _, final = text.removeprefix(_LINEAR).partition("_")
    return linear_schedule(float(initial), float(final or 0))


def hyperparameters(algo: str) -> dict[str, dict[str, Any]]:
    """Hyperparameters by environment, in rl_zoo3's form.

    Args:
        algo: a hemispheric algorithm, such as "hemispheric_ppo", or a stock one, such as "ppo". The values of a stock
            algorithm are those of the hemispheric one, and not tuned for it.
    """
    name = algo.removeprefix("hemispheric_")
    tuned = {env_id: _tuned(name, task) for task, env_id in ENVIRONMENT_IDS.items()}
    if algo in ZOO_ALGORITHMS:
        return tuned | {"default": _other_environments(name)}
    return {env_id: _stock(values) for env_id, values in tuned.items()}


def _other_environments(name: str) -> dict[str, Any]:
    """Hyperparameters for environments that are not ours; all others are left to the algorithm, as in SB3."""
    return {"policy": POLICY, "n_timesteps": 1_000_000} | (_noise(TD3Hyperparameters()) if name == "td3" else {})


def _tuned(name: str, task: str) -> dict[str, Any]:
    config = resolve(name, task)
    assert isinstance(config, RLConfig)
    arguments = {key: _in_words(value) for key, value in algorithm_arguments(config).items()}
    if isinstance(config.hyperparameters, TD3Hyperparameters):
        del arguments["action_noise"]
        arguments |= _noise(config.hyperparameters)
    policy_kwargs = policy_arguments(config)
    del policy_kwargs["architecture"]  # the policy's name says it
    run = {"policy": POLICY, "n_timesteps": config.timesteps, "n_envs": config.n_envs}
    return run | arguments | {"policy_kwargs": plain(policy_kwargs)}


def _noise(config: TD3Hyperparameters) -> dict[str, Any]:
    return {"noise_type": "normal", "noise_std": config.action_noise}


def _in_words(value: Any) -> Any:
    """``value``, or the text that :func:`parse_schedule` reads where it is a schedule."""
    if not isinstance(value, linear_schedule):
        return plain(value)
    if value.initial == value.final:
        return value.initial
    return f"{_LINEAR}{value.initial}" + (f"_{value.final}" if value.final else "")


def _stock(values: dict[str, Any]) -> dict[str, Any]:
    """``values`` without the arguments of hemispheric algorithms alone.

    The entropy bonus of stock PPO and A2C goes too: their estimate for a squashed Gaussian has no expected gradient.
    And of SAC and TD3 only the latter has a delay.
    """
    left_out = _ONLY_HEMISPHERIC | ({"ent_coef"} if "gae_lambda" in values else set())
    left_out |= {"policy_delay"} if "target_entropy" in values else set()
    return {key: value for key, value in values.items() if key not in left_out}
