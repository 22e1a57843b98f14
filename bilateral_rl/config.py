"""The configuration of a training, as typed fields."""

from __future__ import annotations

import dataclasses
import typing
from dataclasses import dataclass, field

from bilateral_rl.bptt.losses import PENALTIES, Penalty
from bilateral_rl.envs.trials import TrialSettings
from bilateral_rl.settings import Values, plain


@dataclass(frozen=True)
class NetworkConfig:
    """The motor network."""

    units: int = 10
    """Units per hidden layer, over both sides."""
    layers: int = 2
    """Hidden layers."""


@dataclass(frozen=True)
class ActorCriticConfig(NetworkConfig):
    """The motor network as an actor, and its critics."""

    critic_arch: tuple[int, ...] = (64, 64)
    """Units of each hidden layer of a critic."""
    log_std_init: float = -0.5
    """Log of the initial standard deviation of the action, before its squashing."""


@dataclass(frozen=True)
class PPOConfig:
    """Arguments of ``HemisphericPPO``; the tuned values are in ``defaults.yaml``."""

    learning_rate: float = 3e-4
    final_learning_rate: float = 0.0
    """Reached linearly at the last step."""
    n_steps: int = 50
    """Steps per arm between updates."""
    batch_size: int = 5120
    n_epochs: int = 5
    gamma: float = 0.99
    gae_lambda: float = 0.95
    clip_range: float = 0.2
    ent_coef: float = 0.0
    """Too little, and the exploration narrows before the hand finds its way."""
    final_ent_coef: float = 0.0
    """Reached linearly at the last step."""
    vf_coef: float = 0.5
    max_grad_norm: float = 0.5
    """Of each parameter group."""
    weight_penalty: float = 0.001
    """λ of paper section 4."""
    reward_scale: float = 1.0


@dataclass(frozen=True)
class EvaluationConfig:
    """Evaluations and saved weights along the way."""

    every: int = 500_000
    """Environment steps between evaluations, whatever ``n_envs`` is."""
    trials: int = 256
    """Trials of an evaluation, the same ones each time, by the deterministic policy."""
    checkpoint_every: int = 2_500_000
    """Environment steps between saved weights."""
    seed: int = 1_000_000
    """Of the evaluation's trials; arm i uses seed + i."""


@dataclass(frozen=True)
class SupervisedConfig:
    """Back-propagation through time as the paper does it (section 5)."""

    learning_rate: float = 0.001
    """Of Adam."""
    epsilon: float = 1e-7
    """Of Adam, added as Keras does: before the bias correction."""
    clip_norm: float = 1.0
    """Of the gradient of each kernel, bias and scalar by itself."""
    batch_size: int = 64
    trials: int = 6400
    """Drawn once for each seed, reshuffled every epoch."""
    validation_trials: int = 64
    patience: int = 3
    """Epochs without a better validation loss after which a seed stops."""
    penalty: str | None = None
    """Kind of weight penalty: "weights", "activity" or "released"; by default the profile's."""
    penalty_coefficient: float | None = None
    """λ of paper section 4; by default the kind's."""


@dataclass(frozen=True)
class TrainConfig:
    """What sets one training apart, whatever the algorithm; each algorithm's configuration adds its own."""

    algo: str = "ppo"
    model: str = "cc_s"
    task: str = "random_reach"
    seed: int = 0
    device: str = "cpu"
    """Where arms and networks are computed: "cpu" or "cuda"."""
    init_from: str | None = None
    """RUN or RUN:seed whose network the training begins with; a fresh one by default."""
    network: NetworkConfig = field(default_factory=NetworkConfig)
    trial: TrialSettings = field(default_factory=TrialSettings)

    def to_values(self) -> Values:
        """Nested dictionaries of plain numbers, strings and lists."""
        return typing.cast(Values, plain(dataclasses.asdict(self)))


@dataclass(frozen=True)
class RLConfig(TrainConfig):
    """A training by reinforcement learning."""

    timesteps: int = 12_000_000
    """Environment steps, over all arms."""
    n_envs: int = 1024
    """Arms simulated at once."""
    threads: int = 1
    """CPU threads of torch. A second one gains a fifth on an idle machine and loses half on a busy one."""
    network: ActorCriticConfig = field(default_factory=ActorCriticConfig)
    ppo: PPOConfig = field(default_factory=PPOConfig)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)


@dataclass(frozen=True)
class BPTTConfig(TrainConfig):
    """A supervised training of one network or of several at once."""

    algo: str = "bptt"
    seeds: int = 1
    """Networks trained at once, of seeds ``seed``, ``seed + 1``, …; each ends as if it had been alone."""
    epochs: int = 100
    """At most."""
    profile: str = "paper"
    """What sets the defaults of the penalty: "paper", its text, or "released", its released code."""
    threads: int = 0
    """CPU threads; 0 for as many as there are."""
    bptt: SupervisedConfig = field(default_factory=SupervisedConfig)

    @property
    def penalty(self) -> Penalty:
        """The kind of weight penalty: the given one or the profile's."""
        return typing.cast(Penalty, self.bptt.penalty or PROFILES[self.profile])

    @property
    def penalty_coefficient(self) -> float:
        """λ: the given one or the kind's."""
        given = self.bptt.penalty_coefficient
        return PENALTIES[self.penalty] if given is None else given


PROFILES: dict[str, Penalty] = {"paper": "weights", "released": "released"}
"""The kind of weight penalty in the paper's text and in its released code (section 4)."""


def config_class(algo: str) -> type[TrainConfig]:
    """The configuration of the algorithm called ``algo``."""
    return BPTTConfig if algo == "bptt" else RLConfig
