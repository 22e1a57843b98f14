"""Hyperparameters of each algorithm, with their bounds; the tuned values are in ``defaults.yaml``.

Upper bounds lie far beyond use, so that a slip of the finger is a sentence and not a full memory.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, Strict
from pydantic.dataclasses import dataclass

from bilateral_rl.envs.quantities import STRICT, NotNegative, Number, Positive, Whole
from bilateral_rl.vocabulary import Penalty

MOST_COUNTED = 10**15
"""Upper bound of steps, epochs and the like."""
MOST_ARMS = 10**6
"""Upper bound of environments and of trials at once."""
MOST_NUMBERS, NUMBERS_PER_STEP = 5 * 10**8, 64
"""Numbers in any of the large arrays, 2 GB, and those kept of a step of an arm, roughly."""

Count = Annotated[Whole, Field(ge=1, le=MOST_COUNTED)]
CountOrNone = Annotated[Whole, Field(ge=0, le=MOST_COUNTED)]
"""A count that may be 0."""
KeptSteps = Annotated[Whole, Field(ge=1, le=MOST_NUMBERS // NUMBERS_PER_STEP)]
AtOnce = Annotated[Whole, Field(ge=1, le=MOST_ARMS)]
Flag = Annotated[bool, Strict(), BeforeValidator(lambda value: value.item() if hasattr(value, "item") else value)]
"""True or false, NumPy's too."""
Fraction = Annotated[Number, Field(ge=0, le=1)]
Decay = Annotated[Number, Field(ge=0, lt=1)]
MOST_TRACES = 8
"""Upper bound of the number of action traces."""


@dataclass(frozen=True, config=STRICT)
class StreamHyperparameters:
    """What every hemispheric algorithm takes."""

    learning_rate: Positive = 3e-4
    """Learning rate at the first step; it changes linearly to ``final_learning_rate``."""
    final_learning_rate: NotNegative = 0.0
    """Learning rate at the last step."""
    gamma: Fraction = 0.99
    """Discount of the reward of one step later."""
    weight_penalty: NotNegative = 0.001
    """λ, the strength of the weight penalty (paper section 4), scaled as the reward is."""
    reward_scale: Positive = 1.0
    """Factor by which both rewards are multiplied before anything learns from them."""
    critic_rate_factor: Annotated[Number, Field(gt=0, le=1000)] = 1.0
    """Learning rate of the critics, in multiples of ``learning_rate``."""
    network_epsilon: Positive | None = None
    """ε of Adam (or RMSprop) for all but the critics; null for that of the optimizer. A larger one gives small
    gradients small steps, so that hemispheres pull against each other more slowly."""
    action_traces: Annotated[tuple[Decay, ...], Field(max_length=MOST_TRACES)] = ()
    """Decays per step of running averages of past actions, which the critics see besides the observation."""


@dataclass(frozen=True, config=STRICT)
class OnPolicyHyperparameters(StreamHyperparameters):
    """What PPO and A2C take."""

    n_steps: KeptSteps = 50
    """Steps of each arm between updates (steps)."""
    gae_lambda: Fraction = 0.95
    """λ of generalized advantage estimation: 0 trusts the critics, 1 the returns."""
    ent_coef: NotNegative = 0.0
    """Weight of the entropy bonus at the first step. Too little, and the exploration narrows before the hand finds its
    way."""
    final_ent_coef: NotNegative = 0.0
    """Weight of the entropy bonus at the last step; it changes linearly."""
    vf_coef: NotNegative = 0.5
    """Weight of the critics' loss."""
    max_grad_norm: Positive = 0.5
    """Largest norm of the gradient of each parameter group."""


@dataclass(frozen=True, config=STRICT)
class PPOHyperparameters(OnPolicyHyperparameters):
    """Arguments of ``HemisphericPPO``."""

    batch_size: Annotated[Whole, Field(ge=2, le=10**7)] = 5120
    """Steps in each gradient step (steps)."""
    n_epochs: Count = 5
    """Times that each rollout is learned from (epochs)."""
    clip_range: Positive = 0.2
    """How far the probability ratio of an action may leave 1 before its gradient is cut."""


@dataclass(frozen=True, config=STRICT)
class A2CHyperparameters(OnPolicyHyperparameters):
    """Arguments of ``HemisphericA2C``."""

    n_steps: KeptSteps = 5
    """Steps of each arm between updates (steps)."""
    gae_lambda: Fraction = 1.0
    """λ of generalized advantage estimation: 0 trusts the critics, 1 the returns."""
    normalize_advantage: Flag = False
    """Whether each stream's advantages are brought to mean 0 and standard deviation 1."""
    use_rms_prop: Flag = True
    """RMSprop as in the original A2C; otherwise Adam."""


@dataclass(frozen=True, config=STRICT)
class OffPolicyHyperparameters(StreamHyperparameters):
    """What SAC and TD3 take."""

    final_learning_rate: NotNegative = 3e-4
    """Learning rate at the last step."""
    buffer_size: KeptSteps | None = 500_000
    """Steps kept, over all arms; None for all of the training's (steps). A buffer that forgets forgets the most varied
    data."""
    learning_starts: CountOrNone = 10_000
    """Steps with random actions before the first update, over all arms (steps)."""
    batch_size: Annotated[Whole, Field(ge=2, le=10**6)] = 256
    """Steps in each update (steps)."""
    tau: Annotated[Number, Field(gt=0, le=1)] = 0.005
    """Share of the critics that enters the target critics at each update."""
    train_freq: Count = 1
    """Steps of each arm between updates (steps)."""
    gradient_steps: Count = 1
    """Updates at a time (updates)."""
    critic_warm_up: CountOrNone = 0
    """Updates of the critics before the first of the network (updates)."""
    policy_delay: Count = 1
    """Updates of the critics for one of the network (updates)."""
    n_critics: Annotated[Whole, Field(ge=1, le=10)] = 2
    """Critics of each reward stream; targets are the smallest value."""
    standardize_inputs: Flag = False
    """Whether the critics see observations and traces standardized, by the steps before the first update."""
    actor_value: Literal["min", "mean", "first"] = "min"
    """What the network follows: the smallest, the mean or the first of a stream's critics."""
    normalize_streams: Flag = False
    """Whether each stream's gradient is divided by the running root mean square of its action gradient."""


@dataclass(frozen=True, config=STRICT)
class SACHyperparameters(OffPolicyHyperparameters):
    """Arguments of ``HemisphericSAC``."""

    ent_coef: NotNegative | None = None
    """The entropy temperature; None to learn it."""
    initial_ent_coef: Positive = 1.0
    """Where a learned temperature begins."""
    target_entropy: Number | None = None
    """Entropy to which a learned temperature steers the policy (nats); None for minus the number of muscles."""


@dataclass(frozen=True, config=STRICT)
class TD3Hyperparameters(OffPolicyHyperparameters):
    """Arguments of ``HemisphericTD3``."""

    actor_value: Literal["min", "mean", "first"] = "first"
    """What the network follows: the smallest, the mean or the first of a stream's critics."""
    action_noise: NotNegative = 0.1
    """Standard deviation of the exploration, added to actions in [-1, 1]."""
    policy_delay: Count = 2
    """Updates of the critics for one of the network and of all targets (updates)."""
    target_policy_noise: Positive = 0.2
    """Standard deviation of the noise on the actions whose value is the target."""
    target_noise_clip: Positive = 0.5
    """Largest size of that noise."""


@dataclass(frozen=True, config=STRICT)
class BPTTHyperparameters:
    """Back-propagation through time as the paper does it (section 5)."""

    learning_rate: Positive = 0.001
    """Learning rate of Adam."""
    final_learning_rate: NotNegative | None = None
    """Learning rate of Adam at the end of all epochs, to which it changes linearly; null for the same throughout."""
    epsilon: Positive = 1e-7
    """ε of Adam, added as Keras does: before the bias correction."""
    clip_norm: Positive = 1.0
    """Largest norm of the gradient of each kernel, bias and scalar by itself."""
    batch_size: AtOnce = 64
    """Trials in each update (trials)."""
    trials: AtOnce = 6400
    """Trials of an epoch, drawn once for each seed and reshuffled every epoch; a multiple of the batches (trials)."""
    validation_trials: AtOnce = 64
    """Trials by which early stopping judges (trials)."""
    patience: Count = 3
    """Epochs without a better validation loss after which a seed stops (epochs)."""
    penalty: Penalty | None = None
    """What the weight penalty is taken of; by default what the profile says."""
    penalty_coefficient: NotNegative | None = None
    """λ of paper section 4; by default the penalty's."""
