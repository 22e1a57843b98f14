"""Stock SAC and TD3 of stable-baselines3 on our arms, for ``learning.py``: their peers in the same table."""

from __future__ import annotations

import time
from typing import Any

import torch
from stable_baselines3 import SAC, TD3
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.config.hyperparameters import OffPolicyHyperparameters
from bilateral_rl.config.schema import RLConfig
from bilateral_rl.envs import ArmVecEnv
from bilateral_rl.training.schedule import Schedule
from bilateral_rl.vocabulary import TEST_SEED, TEST_TRIALS

STOCK = {"sac": SAC, "td3": TD3}
ARCHITECTURE = [64, 64]
"""Hidden layers of actor and critics."""


class Along(BaseCallback):
    """Measures the deterministic policy along the way, as a run's ``evaluations.csv`` does.

    Args:
        config: of our training, whose trials and rhythm it takes.
    """

    def __init__(self, config: RLConfig) -> None:
        super().__init__()
        evaluation = config.evaluation
        self._evaluator = Evaluator(config.make_task(), config.trial, evaluation.trials, evaluation.seed)
        self._every, self._threshold = evaluation.every, config.trial.threshold
        self.rows: list[dict[str, float]] = []
        """A row an evaluation: ``timesteps``, the seconds until then, and the measures."""

    def _on_training_start(self) -> None:
        self._schedule, self._began = Schedule(self._every, self.num_timesteps), time.monotonic()

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        if self._schedule.is_due(self.num_timesteps):
            self._measure()

    def _on_training_end(self) -> None:
        self._measure()

    def _measure(self) -> None:
        record = self._evaluator.run(self.model.policy)  # type: ignore[arg-type] # it acts by predict(), as ours do
        times = {"timesteps": float(self.num_timesteps), "seconds": time.monotonic() - self._began}
        self.rows.append(times | record.summary(self._threshold))


def build(config: RLConfig) -> OffPolicyAlgorithm:
    """SB3's own defaults, on as many arms and with as many updates of as many samples as ``config`` has.

    The reward is the environment's own, the mean of both sides'.
    """
    given = config.hyperparameters
    assert isinstance(given, OffPolicyHyperparameters)
    trial: dict[str, Any] = {name: getattr(config.trial, name) for name in config.trial.__dataclass_fields__}
    return STOCK[config.algo](
        "MlpPolicy",
        ArmVecEnv(config.n_envs, config.make_task(), **trial),
        learning_starts=given.learning_starts,
        batch_size=given.batch_size,
        train_freq=given.train_freq,
        gradient_steps=given.gradient_steps,
        policy_kwargs={"net_arch": ARCHITECTURE},
        seed=config.seed,
        device="cpu",
    )


def train(config: RLConfig) -> tuple[TrialRecord, list[dict[str, float]]]:
    """The tests' trials after training, and the evaluations along the way."""
    torch.set_num_threads(1)
    model, along = build(config), Along(config)
    model.learn(config.timesteps, callback=along, log_interval=10**9)
    test = Evaluator(config.make_task(), config.trial, TEST_TRIALS, TEST_SEED)
    return test.run(model.policy), along.rows  # type: ignore[arg-type]
