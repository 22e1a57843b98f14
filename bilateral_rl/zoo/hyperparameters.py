"""The zoo's hyperparameter files, in rl_zoo3's form: what ``defaults.yaml`` holds for our environments.

``python -m bilateral_rl.zoo.hyperparameters`` writes them anew.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from bilateral_rl.config.parse import plain
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import RLConfig, TD3Config
from bilateral_rl.envs import ENVIRONMENT_IDS
from bilateral_rl.runs.policies import policy_arguments
from bilateral_rl.training.build import algorithm_arguments, linear_schedule
from bilateral_rl.zoo import ALGORITHMS

FOLDER = Path(__file__).parent / "hyperparams"
POLICY = "CallosalPolicy"
_LINEAR = "lin_"
_HEADER = """\
# Written by `python -m bilateral_rl.zoo.hyperparameters` from bilateral_rl/defaults.yaml, where they are tuned.
# lin_A goes linearly from A to 0 over the training, lin_A_B from A to B.
"""
_STOCK_HEADER = "# They are the hemispheric algorithm's, and not tuned for the stock one.\n"


def file_for(algo: str, env_id: str) -> Path | None:
    """The file of this package with the hyperparameters of ``algo`` for ``env_id``; None where the zoo's own serves."""
    ours = algo in ALGORITHMS or env_id in ENVIRONMENT_IDS.values()
    path = FOLDER / f"{algo}.yml"
    return path if ours and path.exists() else None


def schedule(text: str) -> linear_schedule | None:
    """The schedule that ``lin_A`` or ``lin_A_B`` stands for; None for any other text."""
    if not text.startswith(_LINEAR):
        return None
    initial, _, final = text.removeprefix(_LINEAR).partition("_")
    return linear_schedule(float(initial), float(final or 0))


def hyperparameters(algo: str) -> dict[str, dict[str, Any]]:
    """What the file of ``algo``, "hemispheric_ppo" or stock "ppo", holds for each environment."""
    name = algo.removeprefix("hemispheric_")
    tuned = {env_id: _tuned(name, task) for task, env_id in ENVIRONMENT_IDS.items()}
    if algo in ALGORITHMS:
        return tuned | {"default": _other_environments(name)}
    return {env_id: _stock(values) for env_id, values in tuned.items()}


def _other_environments(name: str) -> dict[str, Any]:
    """What is not left to the algorithm, whose defaults are SB3's."""
    return {"policy": POLICY, "n_timesteps": 1_000_000} | (_noise(TD3Config()) if name == "td3" else {})


def _tuned(name: str, task: str) -> dict[str, Any]:
    config = resolve(name, task)
    assert isinstance(config, RLConfig)
    arguments = {key: _in_words(value) for key, value in algorithm_arguments(config).items()}
    if isinstance(config.hyperparameters, TD3Config):
        del arguments["action_noise"]
        arguments |= _noise(config.hyperparameters)
    policy_kwargs = policy_arguments(config)
    del policy_kwargs["architecture"]  # the policy's name says it
    run = {"policy": POLICY, "n_timesteps": config.timesteps, "n_envs": config.n_envs}
    return run | arguments | {"policy_kwargs": plain(policy_kwargs)}


def _noise(config: TD3Config) -> dict[str, Any]:
    return {"noise_type": "normal", "noise_std": config.action_noise}


def _in_words(value: Any) -> Any:
    if not isinstance(value, linear_schedule):
        return value
    if value.initial == value.final:
        return value.initial
    return f"{_LINEAR}{value.initial}" + (f"_{value.final}" if value.final else "")


def _stock(values: dict[str, Any]) -> dict[str, Any]:
    """Without what only hemispheric algorithms take, and the entropy bonus, which does nothing in stock PPO and A2C."""
    left_out = {"loss", "weight_penalty", "reward_scale", "critic_warm_up"}
    if "gae_lambda" in values:
        left_out.add("ent_coef")
    return {key: value for key, value in values.items() if key not in left_out}


def write(folder: Path = FOLDER) -> None:
    """Write every file."""
    for name in ALGORITHMS:
        for algo in (name, name.removeprefix("hemispheric_")):
            header = _HEADER if algo == name else _HEADER + _STOCK_HEADER
            text = header + yaml.safe_dump(hyperparameters(algo), sort_keys=False)
            (folder / f"{algo}.yml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write()
