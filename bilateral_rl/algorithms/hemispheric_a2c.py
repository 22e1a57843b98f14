"""A2C with a reward stream, a critic and an advantage for each hemisphere."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from stable_baselines3 import A2C
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.type_aliases import GymEnv, Schedule

from bilateral_rl.algorithms.on_policy import HemisphericOnPolicy
from bilateral_rl.algorithms.side_logs import Log
from bilateral_rl.policies import BilateralActorCriticPolicy
from bilateral_rl.vocabulary import PENALTY_WEIGHTS, Group, Loss

_RMS_PROP_EPS = 1e-5


class HemisphericA2C(HemisphericOnPolicy, A2C):
    """A2C (Mnih et al. 2016, arXiv 1602.01783) whose reward is a pair, dominant and non-dominant.

    Each stream has its own critic, advantage and policy loss; one optimizer step over the whole rollout applies the
    routed gradients (``algorithms/routing.py``), clipped per parameter group.

    The arguments are those of SB3's ``A2C``, with its defaults, and eight more, from ``loss`` to
    ``network_epsilon``. Two mean something else: ``ent_coef`` and ``max_grad_norm``.

    Args:
        policy: "UnilateralPolicy", "BilateralPolicy" or "CallosalPolicy", or a subclass of
            :class:`~bilateral_rl.policies.BilateralActorCriticPolicy`.
        env: the environment, or its registered id. It gives the pair of rewards as ``last_vector_reward`` (n_envs, 2)
            or ``info["vector_reward"]`` (2,).
        loss: "specialized" for a stream by side; "combined", "dominant" or "non_dominant" for a single stream.
        weight_penalty: λ of the L2 penalty λ · ½ Σ w² on the network (paper section 4). Specialized, the
            non-dominant hemisphere gets it in full (weight 2), shared layers by half, the dominant hemisphere not.
            It is scaled as the rewards are: by ``reward_scale``, and with them when advantages are normalized.
        reward_scale: factor on all rewards before the critics see them; measures and logs are unscaled.
        action_traces: decays, in [0, 1), of running averages of the past actions that the critics see besides the
            observation; none by default. They tell critics of hidden states of actuators, such as the activation of
            muscles (``algorithms/action_traces.py``). The network sees the observation alone.
        frozen: groups of the network's parameters that do not learn, of "dominant", "non_dominant" and "shared";
            critics do, and so does the exploration.
        penalty_weights: weight of the weight penalty in the dominant and in the non-dominant loss, the paper's by
            default.
        critic_rate_factor: learning rate of the critics, in multiples of ``learning_rate``. Critics that learn faster
            than the network know more of what it is to follow. Features extractors learn at the network's rate.
        network_epsilon: ε of Adam (or RMSprop) for all but the critics, beside the root mean square of a gradient; None
            for that of the optimizer. A larger one gives small gradients small steps, so that hemispheres which want a
            little more and a little less of the same command pull against each other more slowly.
        learning_rate: the optimizer's learning rate, a number or a function of the remaining progress (1 to 0).
        n_steps: steps of each environment between updates.
        gamma: discount.
        gae_lambda: trade-off of bias and variance of the generalized advantages; 1 for the classic advantage.
        ent_coef: weight of the entropy of the Gaussian before its squashing, a number or a function of the remaining
            progress. Stock A2C estimates the squashed one's from the sampled actions, with zero expected gradient: a
            bonus that does nothing.
        vf_coef: weight of the value loss.
        max_grad_norm: bound of the gradient norm of each parameter group by itself.
        rms_prop_eps: RMSprop's ε; without RMSprop it must stay as it is.
        use_rms_prop: True for RMSprop, as in the original; False for Adam, with its fused kernel.
        use_sde: must be False: there is no state-dependent exploration (gSDE).
        sde_sample_freq: must be -1, as there is no gSDE.
        rollout_buffer_class: must be None: the streams need a buffer of their own.
        rollout_buffer_kwargs: must be None or empty: all that the buffer takes follows from the algorithm.
        normalize_advantage: whether to normalize each stream's advantages over the rollout.
        stats_window_size: number of trials that logged returns average over.
        tensorboard_log: folder for tensorboard's files; None for none.
        policy_kwargs: arguments of the policy; what the arguments above say of its critics is given by itself.
        verbose: 0 for no output, 1 for information, 2 for debugging.
        seed: seed of all random numbers; None for a random one.
        device: where the networks are: "cpu", "cuda", …, or "auto".

    Raises:
        ValueError: an unknown loss, another policy than bilateral_rl's, observations that are not a Box, or an
            argument that is not available.
    """

    def __init__(
        self,
        policy: str | type[BilateralActorCriticPolicy],
        env: GymEnv | str | None,
        loss: Loss = "specialized",
        weight_penalty: float = 0.001,
        reward_scale: float = 1.0,
        *,
        action_traces: Sequence[float] = (),
        frozen: Sequence[Group] = (),
        penalty_weights: Sequence[float] = PENALTY_WEIGHTS,
        critic_rate_factor: float = 1.0,
        network_epsilon: float | None = None,
        learning_rate: float | Schedule = 7e-4,
        n_steps: int = 5,
        gamma: float = 0.99,
        gae_lambda: float = 1.0,
        ent_coef: float | Schedule = 0.0,
        vf_coef: float = 0.5,
        max_grad_norm: float = 0.5,
        rms_prop_eps: float = _RMS_PROP_EPS,
        use_rms_prop: bool = True,
        use_sde: bool = False,
        sde_sample_freq: int = -1,
        rollout_buffer_class: type[RolloutBuffer] | None = None,
        rollout_buffer_kwargs: dict[str, Any] | None = None,
        normalize_advantage: bool = False,
        stats_window_size: int = 100,
        tensorboard_log: str | None = None,
        policy_kwargs: dict[str, Any] | None = None,
        verbose: int = 0,
        seed: int | None = None,
        device: torch.device | str = "auto",
        _init_setup_model: bool = True,
    ) -> None:
        _check_optimizer(use_rms_prop, rms_prop_eps, policy_kwargs or {})
        super().__init__(
            policy,
            env,
            loss=loss,
            weight_penalty=weight_penalty,
            reward_scale=reward_scale,
            action_traces=action_traces,
            frozen=frozen,
            penalty_weights=penalty_weights,
            critic_rate_factor=critic_rate_factor,
            network_epsilon=network_epsilon,
            learning_rate=learning_rate,
            n_steps=n_steps,
            gamma=gamma,
            gae_lambda=gae_lambda,
            ent_coef=ent_coef,
            vf_coef=vf_coef,
            max_grad_norm=max_grad_norm,
            rms_prop_eps=rms_prop_eps,
            use_rms_prop=use_rms_prop,
            use_sde=use_sde,
            sde_sample_freq=sde_sample_freq,
            rollout_buffer_class=rollout_buffer_class,
            rollout_buffer_kwargs=rollout_buffer_kwargs,
            normalize_advantage=normalize_advantage,
            stats_window_size=stats_window_size,
            tensorboard_log=tensorboard_log,
            policy_kwargs=policy_kwargs,
            verbose=verbose,
            seed=seed,
            device=device,
            _init_setup_model=_init_setup_model,
        )

    def _setup_model(self) -> None:
        # `load` makes attributes of its arguments; SB3 keeps these two in `policy_kwargs`.
        arguments = self.policy_kwargs.get("optimizer_kwargs", {})
        saved = {
            "use_rms_prop": self.policy_kwargs.get("optimizer_class") is torch.optim.RMSprop,
            "rms_prop_eps": arguments.get("eps", _RMS_PROP_EPS),
        }
        for name, value in saved.items():
            if vars(self).pop(name, value) != value:
                raise ValueError(f"a saved model keeps its optimizer, here {name}={value}: leave {name} out of load().")
        super()._setup_model()

    def train(self) -> None:
        """Update the policy from the rollout buffer, once."""
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.policy.optimizer)
        log: Log = defaultdict(list)
        for batch in self.rollout_buffer.get():
            # Policy gradient of stream s: -mean A_s log π(a); the log density (b,) is one for both streams.
            advantages, scales = self._advantages(batch)  # (b, n_streams)
            policy_loss = -(advantages * self._log_prob(batch)[:, None]).mean(dim=0)  # (n_streams,)
            values = self.policy.predict_stream_values(batch.observations, batch.traces)  # (b, n_streams)
            value_loss = (values - batch.returns).square().mean(dim=0)
            self._step(self._stream_losses(policy_loss, value_loss, log), scales, log)
        self._n_updates += 1
        self._check_policy()
        self._record(log)


def _check_optimizer(use_rms_prop: bool, rms_prop_eps: float, policy_kwargs: Mapping[str, Any]) -> None:
    """Refuse settings of an optimizer that is not used: SB3's A2C takes RMSprop with its own, or what is named."""
    uses_rms_prop = use_rms_prop and "optimizer_class" not in policy_kwargs
    if uses_rms_prop and "optimizer_kwargs" in policy_kwargs:
        raise ValueError(
            "optimizer_kwargs have no effect on A2C's own RMSprop: give rms_prop_eps, use_rms_prop=False for Adam, or "
            "an optimizer_class besides."
        )
    if not uses_rms_prop and rms_prop_eps != _RMS_PROP_EPS:
        raise ValueError("rms_prop_eps has no effect without RMSprop: give eps in optimizer_kwargs of policy_kwargs.")
