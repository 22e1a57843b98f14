"""rl_zoo3's experiment, for our algorithms, policies and environments."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Callable, Sequence
from typing import Any

from rl_zoo3.exp_manager import ExperimentManager
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecMonitor

from bilateral_rl.envs import ENVIRONMENT_IDS, ArmVecEnv
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies import POLICY_ALIASES
from bilateral_rl.zoo import ZOO_ALGORITHMS
from bilateral_rl.zoo.hyperparameters import parse_schedule, tuned_module

_TASK_OF_ENVIRONMENT = {env_id: task for task, env_id in ENVIRONMENT_IDS.items()}


class Experiment(ExperimentManager):
    """An experiment with our tuned hyperparameters, and with arms simulated all at once.

    The arguments are those of rl_zoo3's; ``config``, the source of the hyperparameters, is ours by default where we
    have tuned some.
    """

    def __init__(self, args: Any, algo: str, env_id: str, *others: Any, **settings: Any) -> None:
        settings["config"] = settings.get("config") or tuned_module(algo, env_id)
        super().__init__(args, algo, env_id, *others, **settings)

    @staticmethod
    def _preprocess_schedules(hyperparams: dict[str, Any]) -> dict[str, Any]:
        """Replace schedules in words by schedules: ``lin_A_B`` too, and for every hyperparameter."""
        texts = {name: value for name, value in hyperparams.items() if isinstance(value, str)}
        schedules = {name: schedule for name, text in texts.items() if (schedule := parse_schedule(text))}
        others = {name: value for name, value in hyperparams.items() if name not in schedules}
        return ExperimentManager._preprocess_schedules(others) | schedules

    def create_envs(self, n_envs: int, eval_env: bool = False, no_log: bool = False) -> VecEnv:
        """Make the environments; arms are one ``ArmVecEnv``, unless each needs a process or a wrapper of its own."""
        task = _TASK_OF_ENVIRONMENT.get(self.env_name.gym_id)
        if task is None or self.vec_env_class is not DummyVecEnv or self.env_wrapper is not None:
            return super().create_envs(n_envs, eval_env, no_log)
        arms = copy.copy(self)  # trials of a search may run in threads
        arms.vec_env_class = self._arms(task, eval_env, no_log)  # type: ignore[assignment] # all that is done is call it
        return ExperimentManager.create_envs(arms, n_envs, eval_env, no_log)

    def _arms(self, task: str, eval_env: bool, no_log: bool) -> Callable[..., VecEnv]:
        """A stand-in for ``DummyVecEnv`` that reads only the number of environments from its arguments."""
        env_kwargs, file = (self.eval_env_kwargs, None) if eval_env else (self.env_kwargs, f"{self.save_path}/0")
        measures = self.monitor_kwargs.get("info_keywords", ("is_success",))

        def make(single_envs: Sequence[Any]) -> VecEnv:
            env = ArmVecEnv(len(single_envs), task, **env_kwargs)
            with warnings.catch_warnings():  # the arms keep the same statistics, but write no file
                warnings.filterwarnings("ignore", "The environment is already wrapped with a `Monitor`")
                return VecMonitor(env, None if no_log else file, measures)

        return make

    def hyperparameters_optimization(self) -> None:
        """Search as rl_zoo3 does. Raises UserError for a stock algorithm with our policies: it has no search space."""
        if self.algo not in ZOO_ALGORITHMS and self._hyperparams.get("policy") in POLICY_ALIASES:
            raise UserError(
                f"rl_zoo3's search space of {self.algo} is for its own policies; search with --algo "
                f"hemispheric_{self.algo} -params loss:\"'combined'\", which trains the network on the same reward."
            )
        super().hyperparameters_optimization()
