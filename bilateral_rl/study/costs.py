"""What trainings and tables of results take, from what was measured on one core: right to a factor of two."""

from __future__ import annotations

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import BPTTConfig, RLConfig, TrainConfig
from bilateral_rl.study.plan import cost_of

_SECONDS = {"bptt": 13.0, "ppo": 100.0, "a2c": 170.0, "sac": 270.0, "td3": 230.0}
"""To train a network by the default settings, evaluations included (docs/performance.md, docs/tuning.md)."""
_TYPICAL_EPOCHS = 75
"""After which supervised training stops by itself."""
_EPOCH_SECONDS = 0.18
"""An epoch of 6,400 trials in which a network adapts to a lesion."""
_TEST_SECONDS = 0.06
"""A test of 1,024 trials, and all their metrics."""
_TWO_ARMS = 2.2
"""What trials of two arms take against those of one: two arms, and twice the units."""
_LESIONS = {"unilateral": 0, "bilateral": 4, "callosal": 7}


def training_seconds(config: TrainConfig) -> float:
    """Return what a training takes, of all its seeds (s of one core)."""
    share = 1.0
    if isinstance(config, BPTTConfig):
        epochs = min(config.epochs, _TYPICAL_EPOCHS) / _TYPICAL_EPOCHS
        share = epochs * config.bptt.trials / BPTTConfig().bptt.trials
    if isinstance(config, RLConfig):
        share = config.timesteps / resolve(config.algo, config.task).total
    return _SECONDS[config.algo] * _of_arms(config) * share * cost_of(config) * config.seeds


def table_seconds(config: TrainConfig, protocol: Protocol, lesions: int | None = None) -> float:
    """Return what a table of results takes: its lesions, and their control on fresh networks (s of one core).

    Args:
        config: of the training.
        protocol: what follows each lesion.
        lesions: how many they are; None for all that the networks can have.
    """
    lesions = _LESIONS[config.spec.architecture] if lesions is None else lesions
    networks = config.seeds * (2 if lesions else 1)
    epochs = 0 if protocol.retrain == "none" else protocol.epochs
    return networks * (1 + lesions) * _of_arms(config) * (_TEST_SECONDS + _EPOCH_SECONDS * epochs)


def _of_arms(config: TrainConfig) -> float:
    return _TWO_ARMS if config.n_arms == 2 else 1.0
