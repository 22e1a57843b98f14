"""The configuration of a training, as typed fields."""

from __future__ import annotations

import dataclasses
import typing
from dataclasses import dataclass, field

from bilateral_rl.config.parse import Values, plain
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.vocabulary import PENALTIES, PROFILES, Penalty, Profile


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
class StreamConfig:
    """What every hemispheric algorithm takes; the tuned values are in ``defaults.yaml``."""

    learning_rate: float = 3e-4
    final_learning_rate: float = 0.0
    """Reached linearly at the last step."""
    gamma: float = 0.99
    weight_penalty: float = 0.001
    """λ of paper section 4."""
    reward_scale: float = 1.0


@dataclass(frozen=True)
class OnPolicyConfig(StreamConfig):
    """What PPO and A2C take."""

    n_steps: int = 50
    """Steps per arm between updates."""
    gae_lambda: float = 0.95
    ent_coef: float = 0.0
    """Too little, and the exploration narrows before the hand finds its way."""
    final_ent_coef: float = 0.0
    """Reached linearly at the last step."""
    vf_coef: float = 0.5
    max_grad_norm: float = 0.5
    """Of each parameter group."""


@dataclass(frozen=True)
class PPOConfig(OnPolicyConfig):
    """Arguments of ``HemisphericPPO``."""

    batch_size: int = 5120
    n_epochs: int = 5
    clip_range: float = 0.2


@dataclass(frozen=True)
class A2CConfig(OnPolicyConfig):
    """Arguments of ``HemisphericA2C``."""

    n_steps: int = 5
    gae_lambda: float = 1.0
    normalize_advantage: bool = False
    use_rms_prop: bool = True
    """RMSprop as in the original A2C; otherwise Adam."""


@dataclass(frozen=True)
class OffPolicyConfig(StreamConfig):
    """What SAC and TD3 take."""

    final_learning_rate: float = 3e-4
    buffer_size: int = 500_000
    """Steps kept, over all arms."""
    learning_starts: int = 10_000
    """Steps with random actions before the first update."""
    batch_size: int = 256
    tau: float = 0.005
    train_freq: int = 1
    """Steps per arm between updates."""
    gradient_steps: int = 1
    """Updates at a time."""
    critic_warm_up: int = 0
    """Updates of the critics before the first of the network."""
    n_critics: int = 2
    """Of each reward stream; the smallest value counts."""


@dataclass(frozen=True)
class SACConfig(OffPolicyConfig):
    """Arguments of ``HemisphericSAC``."""

    ent_coef: float | None = None
    """The entropy temperature; None to learn it."""
    initial_ent_coef: float = 1.0
    """Where a learned temperature begins."""
    target_entropy: float | None = None
    """What a learned temperature steers to (nats); None for minus the number of muscles."""


@dataclass(frozen=True)
class TD3Config(OffPolicyConfig):
    """Arguments of ``HemisphericTD3``."""

    action_noise: float = 0.1
    """Standard deviation of the exploration, added to actions in [-1, 1]."""
    policy_delay: int = 2
    """Updates of the critics for one of the network."""
    target_policy_noise: float = 0.2
    target_noise_clip: float = 0.5


@dataclass(frozen=True)
class EvaluationConfig:
    """Evaluations and saved weights along the way."""

    every: int = 500_000
    """Environment steps between evaluations, whatever ``n_envs`` is."""
    trials: int = 256
    """Trials of an evaluation, the same ones each time, by the deterministic policy."""
    checkpoint_every: int = 2_500_000
    """Environment steps between saved weights."""
    lesion_probe_every: int = 0
    """Environment steps between tests of every lesion; 0 for none."""
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

    @property
    def total(self) -> int:
        """Largest number of what the training counts: environment steps, or updates of each network."""
        raise NotImplementedError

    @property
    def all_seeds(self) -> list[int]:
        """Seeds of the networks that the run trains."""
        return [self.seed]

    def to_values(self) -> Values:
        """Nested dictionaries of plain numbers, strings and lists."""
        return typing.cast(Values, plain(dataclasses.asdict(self)))


@dataclass(frozen=True)
class RLConfig(TrainConfig):
    """A training by reinforcement learning; each algorithm's configuration adds its hyperparameters, by its name."""

    timesteps: int = 12_000_000
    """Environment steps, over all arms."""
    n_envs: int = 1024
    """Arms simulated at once."""
    threads: int = 1
    """CPU threads of torch. A second one gains a fifth on an idle machine and loses half on a busy one."""
    track: bool = False
    """Whether Weights & Biases follows the training too."""
    network: ActorCriticConfig = field(default_factory=ActorCriticConfig)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)

    @property
    def total(self) -> int:
        return self.timesteps

    @property
    def hyperparameters(self) -> StreamConfig:
        """The algorithm's."""
        return typing.cast(StreamConfig, getattr(self, self.algo))


@dataclass(frozen=True)
class PPORunConfig(RLConfig):
    """A training by PPO."""

    algo: str = "ppo"
    ppo: PPOConfig = field(default_factory=PPOConfig)


@dataclass(frozen=True)
class A2CRunConfig(RLConfig):
    """A training by A2C."""

    algo: str = "a2c"
    a2c: A2CConfig = field(default_factory=A2CConfig)


@dataclass(frozen=True)
class SACRunConfig(RLConfig):
    """A training by SAC."""

    algo: str = "sac"
    sac: SACConfig = field(default_factory=SACConfig)


@dataclass(frozen=True)
class TD3RunConfig(RLConfig):
    """A training by TD3."""

    algo: str = "td3"
    td3: TD3Config = field(default_factory=TD3Config)


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
    def total(self) -> int:
        return self.epochs * self.updates_per_epoch

    @property
    def updates_per_epoch(self) -> int:
        """Updates of each network in an epoch."""
        return self.bptt.trials // self.bptt.batch_size

    @property
    def all_seeds(self) -> list[int]:
        return [self.seed + i for i in range(self.seeds)]

    @property
    def penalty(self) -> Penalty:
        """The kind of weight penalty: the given one or the profile's."""
        return typing.cast(Penalty, self.bptt.penalty or PROFILES[typing.cast(Profile, self.profile)])

    @property
    def penalty_coefficient(self) -> float:
        """λ: the given one or the kind's."""
        given = self.bptt.penalty_coefficient
        return PENALTIES[self.penalty] if given is None else given


CONFIGS: dict[str, type[TrainConfig]] = {
    "ppo": PPORunConfig,
    "a2c": A2CRunConfig,
    "sac": SACRunConfig,
    "td3": TD3RunConfig,
    "bptt": BPTTConfig,
}
"""The configuration of each algorithm."""
