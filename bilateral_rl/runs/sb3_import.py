"""Import of models that stable-baselines3 saved: zip files, which execute code when they are loaded."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.save_util import load_from_zip_file

from bilateral_rl.algorithms import ALGORITHM_CLASSES
from bilateral_rl.algorithms.saved_models import algorithm_of
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.config.parse import Values, plain
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import CONFIGS, NetworkConfig, RLConfig, TrainConfig
from bilateral_rl.config.tasks import TaskWords, choose_task
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.tensors import Tensors
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.runs.folder import FINAL, IMPORTED, RunFolder
from bilateral_rl.runs.normalized_observations import Statistics, shows_normalization
from bilateral_rl.runs.policies import build_policy, unfit
from bilateral_rl.vocabulary import PENALTY_WEIGHTS, SIDES, group_penalties


@dataclass(frozen=True)
class SavedModel:
    """A model that a stable-baselines3 algorithm saved by ``model.save``, with a policy of this package.

    Args:
        path: the file.
        data: the algorithm's attributes, by name.
        weights: the policy's ``state_dict()``.
    """

    path: Path
    data: Mapping[str, Any]
    weights: Tensors

    @classmethod
    def load(cls, path: Path) -> SavedModel:
        """Read ``path``, which executes whatever code it holds. Raises UserError if it is no such model."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # about attributes that another version pickled, and nobody needs here
                data, parameters, _ = load_from_zip_file(path, device="cpu")
            return cls(path, dict(data or {}), dict(parameters["policy"]))
        except Exception as error:  # pickles raise anything
            raise UserError(f"{path} is no model saved by stable-baselines3: {error!r}.") from None

    @property
    def algo(self) -> str:
        """The algorithm's name, as in ``--algo``. Raises UserError for a policy that is not of this package."""
        policy = self.data.get("policy_class")
        fitting = [name for name, algorithm in ALGORITHM_CLASSES.items() if _is_a(policy, algorithm.POLICY_CLASS)]
        if not fitting:
            name = getattr(policy, "__name__", policy)
            raise UserError(f"{self.path} has the policy {name}; only those of bilateral_rl have hemispheres.")
        if fitting == ["ppo", "a2c"]:
            return algorithm_of(self.data).lower()
        return fitting[0]

    def policy(self) -> MotorPolicy:
        """Build the trained policy. Raises UserError if it cannot be built or does not act on the arm."""
        self._check_spaces()
        try:
            policy: MotorPolicy = self.data["policy_class"](
                self.data["observation_space"],
                self.data["action_space"],
                lr_schedule=lambda _: 0.0,
                **self.data.get("policy_kwargs", {}),
            )
            policy.load_state_dict(self.weights)
        except Exception as error:  # pickles raise anything
            raise UserError(f"The policy of {self.path} cannot be built: {error!r}.") from None
        broken = [name for name, tensor in self.weights.items() if not tensor.isfinite().all()]
        if broken:
            raise UserError(f"The weights of {self.path} are not finite numbers in {', '.join(broken)}.")
        return policy

    def config(self, task: TaskWords, overrides: Mapping[str, Any]) -> TrainConfig:
        """Build the configuration of a run with this policy, as far as the model tells, with ``overrides`` over it.

        Raises:
            UserError: no configuration describes this model.
        """
        algo, policy = self.algo, self.policy()
        network = policy.motor_network
        self._check_arms(network.n_arms, task, overrides)
        trained_by = self.data.get("loss", "combined")
        names = [n for n, m in MODELS.items() if (m.architecture, m.loss) == (network.architecture, trained_by)]
        if not names:
            raise UserError(f"{self.path} is {network.architecture}, trained by {trained_by}: there is no such model.")
        stored: Values = {
            "model": names[0],
            "seed": self.data.get("seed") or 0,
            "timesteps": max(self.data.get("num_timesteps", 0), 1),
            "n_envs": self.data.get("n_envs", 1),
            "network": {
                **{field.name: getattr(network, field.name, None) for field in dataclasses.fields(NetworkConfig)},
                "hidden_noise": network.noise.std,
                "critic_arch": getattr(policy, "critic_arch", ()),
                **({} if algo == "td3" else {"log_std_init": self._log_std_init}),
            },
            algo: self._hyperparameters(algo, policy),
            "trial": {"losses": {side: {"penalty": w} for side, w in zip(SIDES, self._penalty_weights, strict=True)}},
        }
        return resolve(algo, task, [stored, overrides])

    def _check_arms(self, n_arms: int, task: TaskWords, overrides: Mapping[str, Any]) -> None:
        """Raise a UserError for a task of another number of arms than the network's."""
        found = choose_task(task, [overrides], TrainConfig.task)
        if found.n_arms != n_arms:
            raise UserError(
                f"The network of {self.path} commands {'both arms' if n_arms == 2 else 'one arm'}, and {found.task} is "
                f"for {'both' if found.n_arms == 2 else 'one'}: choose another --task."
            )

    @property
    def _log_std_init(self) -> float:
        return float(self.data.get("policy_kwargs", {}).get("log_std_init", 0.0))

    @property
    def _penalty_weights(self) -> Sequence[float]:
        weights: Sequence[float] = self.data.get("penalty_weights", PENALTY_WEIGHTS)
        return weights

    @property
    def normalized_observations(self) -> bool | None:
        """Whether it was trained on observations that ``VecNormalize`` had normalized; None where nothing tells."""
        told: bool | None = self.data.get("normalized_observations")
        if told is None and shows_normalization(self.data.get("_last_obs")):
            return True
        return told

    def _hyperparameters(self, algo: str, policy: MotorPolicy) -> Values:
        """Collect the algorithm's hyperparameters that are plain numbers, or schedules of them."""
        config = CONFIGS[algo]()
        assert isinstance(config, RLConfig)
        names = [field.name for field in dataclasses.fields(config.hyperparameters)]
        stock = {"weight_penalty": 0.0, "reward_scale": 1.0, "standardize_inputs": False, "normalize_streams": False}
        stored = {**stock, **self.data, "n_critics": getattr(policy, "n_critics", None)}
        values = {name: _number(stored.get(name), 1.0) for name in names}
        final = {name: _number(stored.get(name.removeprefix("final_")), 0.0) for name in names if "final_" in name}
        algorithm = ALGORITHM_CLASSES[algo]  # whose attributes are those of models from before there was a choice
        of_class = ("action_traces", "actor_value", "critic_rate_factor", "network_epsilon")
        others = {name: self.data.get(name, getattr(algorithm, name, None)) for name in of_class}
        others["use_rms_prop"] = self.data.get("policy_kwargs", {}).get("optimizer_class") is torch.optim.RMSprop
        if not any(group_penalties(self.data.get("loss", "combined"), None, self._penalty_weights).values()):
            values["weight_penalty"] = 0.0  # whatever it was, it had no effect
        chosen = values | final | {name: value for name, value in others.items() if name in names}
        return {name: plain(value) for name, value in chosen.items() if value is not None}

    def _check_spaces(self) -> None:
        """Raise a UserError unless the model observes and commands what one arm or two do."""
        observed, commanded = self.data.get("observation_space"), self.data.get("action_space")
        sizes = {n_arms: (len(TrialSettings().observation_bounds(n_arms)[0]), n_arms * N_MUSCLES) for n_arms in (1, 2)}
        if not any(
            getattr(observed, "shape", None) == (n_observed,)
            and _is_same_box(commanded, spaces.Box(-1.0, 1.0, (n_muscles,)))
            for n_observed, n_muscles in sizes.values()
        ):
            raise UserError(
                f"{self.path} does not act on the arm: it observes {observed} and commands {commanded}, not "
                f"{sizes[1][0]} numbers and {sizes[1][1]} muscles from -1 to 1, or of two arms {sizes[2][0]} and "
                f"{sizes[2][1]}."
            )


def import_model(
    path: Path, task: TaskWords, overrides: Mapping[str, Any], out: Path, vec_normalize: Path | None = None
) -> RunFolder:
    """Make a run below ``out`` of the model that stable-baselines3 saved as ``path``; loading it executes code.

    Args:
        path: the zip file.
        task: the task that it was trained for.
        overrides: settings that the file does not tell.
        out: folder of all runs.
        vec_normalize: statistics of observations, as ``VecNormalize.save`` writes them, to be folded into the network.

    Raises:
        UserError: the file is no model of this package, does not fit the arm or the settings, was trained on other
            observations than the arm's, or the run cannot be written.
    """
    model = SavedModel.load(path)
    config = model.config(task, overrides)
    policy = build_policy(config)
    if wrong := unfit(policy, model.weights):
        raise UserError(
            f"The policy of {path} has parts that no run has, or not of this size: {wrong[0]} does not fit the "
            "settings."
        )
    policy.load_state_dict(model.weights)
    origin: dict[str, Any] = {"imported_from": path.name}
    normalized = model.normalized_observations
    if vec_normalize is None and normalized:
        raise UserError(
            f"{path} was trained on observations that VecNormalize had normalized, without which it acts otherwise: "
            "give the file of their statistics, which `env.save(FILE)` writes, as --vec-normalize FILE."
        )
    if vec_normalize is not None:
        if normalized is False:
            raise UserError(f"{path} was trained on observations as they are: leave --vec-normalize out.")
        statistics = Statistics.load(vec_normalize, len(config.trial.observation_bounds(config.n_arms)[0]))
        statistics.fold_into(policy)
        origin |= {
            "vec_normalize": vec_normalize.name,
            "clipped_observations": statistics.clipped_share(policy, config.make_task(), config.trial),
        }
    folder = RunFolder.create(out, config)
    folder.save_weights(FINAL, dict(policy.state_dict()) if vec_normalize else model.weights)
    status = {"state": IMPORTED, "timesteps": model.data.get("num_timesteps", 0), "weights": FINAL}
    folder.write_json("status.json", status | origin)
    return folder


def _is_a(policy: object, cls: type) -> bool:
    return isinstance(policy, type) and issubclass(policy, cls)


def _is_same_box(space: object, box: spaces.Box) -> bool:
    if not isinstance(space, spaces.Box):
        return False
    return np.array_equal(space.low, box.low) and np.array_equal(space.high, box.high)


def _number(value: Any, remaining: float) -> float | int | None:
    """Return a number, or what a schedule of it gives where ``remaining`` of 1 is left; None for anything else."""
    value = getattr(value, "frequency", value)  # of a TrainFreq
    value = value(remaining) if callable(value) else value
    return value if isinstance(value, (int, float)) else None
