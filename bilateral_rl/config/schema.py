"""The configuration of a training, as typed fields with their bounds."""

from __future__ import annotations

import os
import re
import typing
from abc import ABC, abstractmethod
from dataclasses import field
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field
from pydantic.dataclasses import dataclass

from bilateral_rl.config.catalogue import MAX_SEEDS, ModelSpec, find_model
from bilateral_rl.config.code_tasks import code_task, is_code
from bilateral_rl.config.hyperparameters import (
    A2CHyperparameters,
    AtOnce,
    BPTTHyperparameters,
    Count,
    CountOrNone,
    Flag,
    Fraction,
    PPOHyperparameters,
    SACHyperparameters,
    StreamHyperparameters,
    TD3Hyperparameters,
)
from bilateral_rl.config.parse import Values, plain_values
from bilateral_rl.config.tasks import JudgedBy, TaskChoice
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.experiments.experiment import Experiment
from bilateral_rl.envs.quantities import STRICT, NotNegative, Number, Whole
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.vocabulary import PENALTIES, PROFILES, Group, Penalty, Profile

if TYPE_CHECKING:
    from bilateral_rl.envs.tasks import Task

MAX_SEED = 2**32 - 1
MOST_UNITS, MOST_LAYERS, MOST_THREADS = 10_000, 100, 1_000


def _as_word(value: object) -> object:
    """Take a path or a torch.device for the word that it writes."""
    return str(value) if isinstance(value, os.PathLike) or type(value).__module__ == "torch" else value


def _device(value: str) -> str:
    if not re.fullmatch(r"cpu|cuda(:[0-9]{1,3})?", value):
        raise ValueError(f"must be cpu, cuda or, for one of several, cuda:0 and so on, got {value!r}")
    return value


def _as_several(value: object) -> object:
    """Take one word for a list of it."""
    return (value,) if isinstance(value, str) else value


def _once_each(groups: tuple[Group, ...]) -> tuple[Group, ...]:
    if len(set(groups)) < len(groups):
        raise ValueError(f"must name each group once, got {', '.join(groups)}")
    return groups


Groups = Annotated[tuple[Group, ...], BeforeValidator(_as_several), AfterValidator(_once_each)]
Seed = Annotated[Whole, Field(ge=0, le=MAX_SEED)]
Units = Annotated[Whole, Field(ge=1, le=MOST_UNITS)]
Device = Annotated[str, BeforeValidator(_as_word), AfterValidator(_device)]
RunPath = Annotated[str, BeforeValidator(_as_word)]


@dataclass(frozen=True, config=STRICT)
class NetworkConfig:
    """The motor network."""

    units: Units = 10
    """Units per hidden layer, over both sides; in tasks of two arms 20 by default."""
    layers: Annotated[Whole, Field(ge=1, le=MOST_LAYERS)] = 2
    """Hidden layers."""
    hidden_noise: NotNegative = 0.0
    """Standard deviation of the noise that is added to each hidden unit's activity, in training and in tests."""
    ipsilateral_share: Fraction | None = None
    """Of two arms: weight of each hemisphere in the commands to the arm of its own side, where the arm opposite to it
    gets the rest; 0 for no such path at all, null for 0.15."""
    trained_combination: Flag | None = None
    """Of two arms: whether those weights only begin so, and are trained and kept at 0 or more, as those of one arm
    always are; null for false."""


@dataclass(frozen=True, config=STRICT)
class CriticsConfig(NetworkConfig):
    """The motor network and its critics."""

    critic_arch: Annotated[tuple[Units, ...], Field(min_length=1, max_length=MOST_LAYERS)] = (64, 64)
    """Units of each hidden layer of a critic."""


@dataclass(frozen=True, config=STRICT)
class ActorCriticConfig(CriticsConfig):
    """The motor network as an actor that samples, and its critics."""

    log_std_init: Number = -0.5
    """Log of the initial standard deviation of the action, before its squashing."""


@dataclass(frozen=True, config=STRICT)
class EvaluationConfig:
    """Evaluations and saved weights along the way."""

    every: Count = 500_000
    """Environment steps between evaluations, over all arms (steps)."""
    trials: AtOnce = 256
    """Trials of an evaluation, the same ones each time, by the deterministic policy (trials)."""
    checkpoint_every: Count = 2_500_000
    """Environment steps between saved weights, over all arms (steps)."""
    lesion_probe_every: CountOrNone = 0
    """Environment steps between tests of every lesion, over all arms; 0 for none (steps)."""
    seed: Seed = 1_000_000
    """Seed of the evaluation's trials; arm i uses seed + i."""


@dataclass(frozen=True, config=STRICT)
class BlocksConfig:
    """Tests along an adaptation to the field of an experiment, which has them by default."""

    every: CountOrNone = 0
    """Updates of a BPTT, or environment steps over all arms, from one test to the next; 0 for none."""
    trials: AtOnce = 64
    """Trials in each condition, the same ones each time, by the deterministic policy (trials)."""


@dataclass(frozen=True, config=STRICT)
class TrainConfig(ABC):
    """What sets one training apart, whatever the algorithm; each algorithm's configuration adds its own."""

    algo: str = "ppo"
    """The algorithm: "ppo", "a2c", "sac", "td3" or "bptt"."""
    model: str = "cc_s"
    """The network and what trains it, such as "cc_s"; ``bilateral-rl list`` names all."""
    task: str = "random_reach"
    """What the arm is to do: a task or an experiment by its name, or a class as ``module:Class``."""
    experiment: Experiment | None = None
    """The experiment, where the task is one."""
    seed: Seed = 0
    """Seed of weights, exploration and trials."""
    seeds: Annotated[Whole, Field(ge=1, le=MAX_SEEDS)] = 1
    """Networks to train, of seeds ``seed``, ``seed + 1``, …; each ends as if it had been alone."""
    device: Device = "cpu"
    """Where arms and networks are computed: "cpu", "cuda" or "cuda:N"."""
    threads: Annotated[Whole, Field(ge=0, le=MOST_THREADS)] = 0
    """CPU threads; 0 for as many as there are."""
    init_from: RunPath | None = None
    """RUN or RUN:seed whose network the training begins with; a fresh one by default."""
    frozen: Groups = ()
    """Parameter groups of the network that do not learn: any two of dominant, non_dominant and shared."""
    blocks: BlocksConfig = field(default_factory=BlocksConfig)
    network: NetworkConfig = field(default_factory=NetworkConfig)
    trial: TrialSettings = field(default_factory=TrialSettings)

    @property
    @abstractmethod
    def total(self) -> int:
        """Largest number of what the training counts: environment steps of all seeds, or updates of each network."""

    @property
    @abstractmethod
    def unit(self) -> str:
        """What the training counts: "steps" or "updates"."""

    @property
    @abstractmethod
    def plan(self) -> str:
        """What the training is about to do with each network, in words."""

    @property
    @abstractmethod
    def penalty_coefficient(self) -> float:
        """λ of the weight penalty (paper section 4)."""

    @property
    def all_seeds(self) -> list[int]:
        """Seeds of the networks that the run trains."""
        return [self.seed + i for i in range(self.seeds)]

    def make_task(self) -> Task:
        """Return the task.

        Raises:
            UserError: it is a class that the user has not named to this process, or that cannot be imported.
        """
        if self.experiment is None and is_code(self.task):
            return code_task(self.task)
        from bilateral_rl.envs.tasks import make_task  # numerical

        return make_task(self.task if self.experiment is None else self.experiment)

    @property
    def judged_by(self) -> JudgedBy:
        """The measure that says how well the task is done, "goal_completion" or "time_in_goal"."""
        return TaskChoice(self.task, self.experiment).judged_by

    @property
    def n_arms(self) -> Literal[1, 2]:
        """How many arms the task is for; 1 for a class that nobody has named to this process, whatever it is."""
        return TaskChoice(self.task, self.experiment).n_arms

    @property
    def n_muscles(self) -> int:
        """Muscles of all arms."""
        return N_MUSCLES * self.n_arms

    @property
    def task_folder(self) -> str:
        """The folder of the task's runs among all: the task's id."""
        return self.make_task().id if self.experiment is None and is_code(self.task) else self.task

    @property
    def spec(self) -> ModelSpec:
        """The model's architecture and loss."""
        return find_model(self.model)

    @property
    def lesion_profile(self) -> Profile:
        """Whose lesions the networks get when they are tested: the paper's or those of its released code."""
        return "paper"

    def to_values(self) -> Values:
        """Return nested dictionaries of plain numbers, strings and lists."""
        return plain_values(self)


@dataclass(frozen=True, config=STRICT)
class RLConfig(TrainConfig):
    """A training by reinforcement learning; each algorithm's configuration adds its hyperparameters, by its name."""

    timesteps: Count = 12_000_000
    """Environment steps of the training, over all arms (steps)."""
    n_envs: AtOnce = 1024
    """Arms simulated at once."""
    threads: Annotated[Whole, Field(ge=1, le=MOST_THREADS)] = 1
    """CPU threads of torch. A second one gains a fifth on an idle machine and loses half on a busy one."""
    track: Flag = False
    """Whether Weights & Biases follows the training too."""
    network: CriticsConfig = field(default_factory=CriticsConfig)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)

    @property
    def total(self) -> int:
        return self.timesteps * self.seeds

    @property
    def unit(self) -> str:
        return "steps"

    @property
    def plan(self) -> str:
        return f"{self.timesteps:,} steps over {self.n_envs} {'arms' if self.n_arms == 1 else 'pairs of arms'}"

    @property
    def penalty_coefficient(self) -> float:
        return self.hyperparameters.weight_penalty

    @property
    def hyperparameters(self) -> StreamHyperparameters:
        """The algorithm's hyperparameters."""
        return typing.cast(StreamHyperparameters, getattr(self, self.algo))


@dataclass(frozen=True, config=STRICT)
class PPOConfig(RLConfig):
    """A training by PPO."""

    algo: str = "ppo"
    network: ActorCriticConfig = field(default_factory=ActorCriticConfig)
    ppo: PPOHyperparameters = field(default_factory=PPOHyperparameters)


@dataclass(frozen=True, config=STRICT)
class A2CConfig(RLConfig):
    """A training by A2C."""

    algo: str = "a2c"
    network: ActorCriticConfig = field(default_factory=ActorCriticConfig)
    a2c: A2CHyperparameters = field(default_factory=A2CHyperparameters)


@dataclass(frozen=True, config=STRICT)
class SACConfig(RLConfig):
    """A training by SAC."""

    algo: str = "sac"
    network: ActorCriticConfig = field(default_factory=ActorCriticConfig)
    sac: SACHyperparameters = field(default_factory=SACHyperparameters)


@dataclass(frozen=True, config=STRICT)
class TD3Config(RLConfig):
    """A training by TD3."""

    algo: str = "td3"
    td3: TD3Hyperparameters = field(default_factory=TD3Hyperparameters)


@dataclass(frozen=True, config=STRICT)
class BPTTConfig(TrainConfig):
    """A supervised training of one network or of several at once."""

    algo: str = "bptt"
    epochs: Count = 100
    """Length of the training, unless early stopping ends it before (epochs)."""
    profile: Profile = "paper"
    """What sets the defaults of the penalty: "paper", its text, or "released", its released code."""
    bptt: BPTTHyperparameters = field(default_factory=BPTTHyperparameters)

    @property
    def total(self) -> int:
        return self.epochs * self.updates_per_epoch

    @property
    def unit(self) -> str:
        return "updates"

    @property
    def plan(self) -> str:
        epochs = "1 epoch" if self.epochs == 1 else f"up to {self.epochs} epochs"
        return f"{epochs} of {self.bptt.trials:,} trials"

    @property
    def updates_per_epoch(self) -> int:
        """Updates of each network in an epoch."""
        return self.bptt.trials // self.bptt.batch_size

    @property
    def lesion_profile(self) -> Profile:
        return self.profile

    @property
    def penalty(self) -> Penalty:
        """The kind of weight penalty: the chosen one or the profile's."""
        return self.bptt.penalty or PROFILES[self.profile]

    @property
    def penalty_coefficient(self) -> float:
        """λ: the chosen one or the kind's."""
        chosen = self.bptt.penalty_coefficient
        return PENALTIES[self.penalty] if chosen is None else chosen


CONFIGS: dict[str, type[TrainConfig]] = {
    "ppo": PPOConfig,
    "a2c": A2CConfig,
    "sac": SACConfig,
    "td3": TD3Config,
    "bptt": BPTTConfig,
}
"""The configuration of each algorithm."""
