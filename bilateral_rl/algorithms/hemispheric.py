"""The base class of every hemispheric algorithm: reward streams, routed updates, logs by side."""

from __future__ import annotations

import copy
import io
import pathlib
import warnings
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.preprocessing import get_action_dim
from stable_baselines3.common.type_aliases import GymEnv, MaybeCallback, TensorDict
from stable_baselines3.common.vec_env import VecEnv, VecNormalize
from torch import Tensor, nn

from bilateral_rl.algorithms.action_traces import ActionTraces, checked_decays
from bilateral_rl.algorithms.arguments import EVERY, Check, arguments_of_load, checked
from bilateral_rl.algorithms.finite import check_actions, check_observations, check_policy
from bilateral_rl.algorithms.normalized_observations import other_normalization
from bilateral_rl.algorithms.optimizer_groups import load_separated, separate, set_rates
from bilateral_rl.algorithms.outer_rewards import RewardPairs, check_one_reward
from bilateral_rl.algorithms.routing import add_weight_penalty, assign_routed_gradients, policy_shares
from bilateral_rl.algorithms.saved_models import check_saved_by
from bilateral_rl.algorithms.schedules import linear_schedule
from bilateral_rl.algorithms.side_logs import (
    Log,
    name_stream_returns,
    record_averages,
    record_combination,
    record_stream_returns,
)
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.policies.motor_policy import check_commands
from bilateral_rl.policies.sb3_arguments import available
from bilateral_rl.vocabulary import PENALTY_WEIGHTS, Group, Loss, group_penalties, stream_mix, stream_names

_STATE_DEPENDENT_EXPLORATION = {"use_sde": False, "sde_sample_freq": -1, "use_sde_at_warmup": False}
"""Arguments of SB3 that mean nothing without gSDE, with the one value that each may have."""


_USUAL_PENALTY = 0.001
"""What ``weight_penalty`` is by default."""
_OF_BUFFERS = {
    "buffer_size", "observation_space", "action_space", "device", "gamma", "gae_lambda", "n_envs",
    "optimize_memory_usage",
}  # fmt: skip
"""Arguments that SB3 gives to buffers by itself."""


class Hemispheric(BaseAlgorithm):
    """Base class of the algorithms whose reward is a pair, dominant and non-dominant; mix it into one of SB3's.

    The environment gives the pair as ``venv.last_vector_reward`` (n_envs, 2), or as ``info["vector_reward"]`` (2,).
    Where there are several, the outermost counts, and its mean must be the reward that ``step`` returned: what wraps an
    environment in another reward, and leaves the pair, is refused. ``VecNormalize`` normalizes each stream's reward as
    it does their mean. With ``loss`` other than "specialized" there is one stream, and the arithmetic is the SB3
    parent's; "combined" learns by the reward that ``step`` returned, whatever the pair is.

    The constructors of the algorithms list all their arguments; this one takes its own out of them and gives the
    others to the SB3 parent.

    Raises:
        ValueError: an unknown loss, a policy that is not bilateral_rl's, decays of traces that are not in [0, 1), or
            observations that are not a Box.
    """

    policy: MotorPolicy
    # Of models that were saved before there were these:
    action_traces: tuple[float, ...] = ()
    frozen: tuple[Group, ...] = ()
    penalty_weights: tuple[float, float] = PENALTY_WEIGHTS
    critic_rate_factor: float = 1.0
    network_epsilon: float | None = None
    normalized_observations: bool | None = None
    """Whether it was trained on observations that ``VecNormalize`` normalized; None if it was not, or not yet."""
    _last_traces: NDArray[np.float32] | None = None  # (n_envs, n): of the actions before the last observation
    POLICY_CLASS: ClassVar[type[MotorPolicy]]
    """The class that ``policy`` must be of."""
    CHECKS: ClassVar[Mapping[str, Check]] = EVERY
    """What each argument may be."""
    FIXED: ClassVar[tuple[str, ...]] = ("loss", "action_traces", "frozen", "policy_kwargs", "seed")
    """Attributes of which what is built depends, so that another value afterwards would be half ignored."""

    def __init__(
        self,
        policy: str | type[MotorPolicy],
        env: GymEnv | str | None,
        *,
        loss: Loss,
        weight_penalty: float,
        reward_scale: float,
        action_traces: Sequence[float],
        frozen: Sequence[Group],
        penalty_weights: Sequence[float],
        critic_rate_factor: float,
        network_epsilon: float | None,
        policy_kwargs: dict[str, Any] | None,
        **sb3_arguments: Any,
    ) -> None:
        if isinstance(policy, type) and not issubclass(policy, self.POLICY_CLASS):
            raise ValueError(f"{type(self).__name__} needs a {self.POLICY_CLASS.__name__}, not {policy.__name__}.")
        if isinstance(policy, str) and policy not in self.policy_aliases:
            names = ", ".join(self.policy_aliases)
            raise ValueError(f"{type(self).__name__} has no policy {policy!r}; choose from {names}.")
        self.loss = loss
        self.weight_penalty = weight_penalty
        self.reward_scale = reward_scale
        self.action_traces = checked_decays(action_traces)
        own = checked({"frozen": frozen, "penalty_weights": penalty_weights}, EVERY)
        self.frozen, self.penalty_weights = own["frozen"], own["penalty_weights"]
        self.critic_rate_factor, self.network_epsilon = critic_rate_factor, network_epsilon
        _warn_of_no_penalty(loss, weight_penalty, self.penalty_weights, stacklevel=4)
        critics_of = {"n_streams": len(stream_mix(loss)), "n_traces": len(self.action_traces)}
        policy_kwargs = critics_of | available(policy_kwargs or {})
        super().__init__(policy, env, policy_kwargs=policy_kwargs, **checked(sb3_arguments, self.CHECKS))

    @classmethod
    def load(
        cls,
        path: str | pathlib.Path | io.BufferedIOBase,
        env: GymEnv | None = None,
        device: torch.device | str = "auto",
        custom_objects: dict[str, Any] | None = None,
        print_system_info: bool = False,
        force_reset: bool = True,
        **kwargs: Any,
    ) -> Self:
        """Load a model as SB3 does, which executes code that the file holds; ``kwargs`` are what it shall have anew.

        Raises:
            ValueError: ``kwargs`` that no constructor takes, or that a saved model keeps, or a model of another
                algorithm.
        """
        blank = vars(cls(next(iter(cls.policy_aliases)), None, _init_setup_model=False))  # type: ignore[call-arg]
        changes = arguments_of_load(cls, kwargs, blank)
        check_saved_by(path, cls.__name__, blank)
        try:
            model = super().load(path, env, device, custom_objects, print_system_info, force_reset, **changes)
        except KeyError as error:
            # SB3 takes every ValueError of `set_parameters` for one of DQN's, and looks for what DQN alone has.
            if isinstance(error.__context__, ValueError):
                raise error.__context__ from None
            raise
        model._tell_normalization()
        if "weight_penalty" in kwargs:
            _warn_of_no_penalty(model.loss, model.weight_penalty, model.penalty_weights, stacklevel=3)
        return model

    def set_parameters(
        self, load_path_or_dict: str | TensorDict, exact_match: bool = True, device: torch.device | str = "auto"
    ) -> None:
        """Load parameters as SB3 does; where it refuses some, all stay as they were."""
        present = copy.deepcopy(self.get_parameters())
        try:
            super().set_parameters(load_path_or_dict, exact_match, device)
        except Exception:  # torch has copied what fits before it complains of the rest
            super().set_parameters(present, device=device)  # type: ignore[arg-type] # SB3 takes what it gives
            raise

    @staticmethod
    def _wrap_env(env: GymEnv, verbose: int = 0, monitor_wrapper: bool = True) -> VecEnv:
        check_one_reward(env)
        check_commands(env.action_space)  # here, as some of SB3's algorithms assert it and others do not
        return BaseAlgorithm._wrap_env(env, verbose, monitor_wrapper)

    def set_env(self, env: GymEnv, force_reset: bool = True) -> None:
        """Take another environment as SB3 does; warns where it does not normalize observations as the one before."""
        super().set_env(env, force_reset)
        self._tell_normalization()

    def set_random_seed(self, seed: int | None = None) -> None:
        """Let all random numbers begin anew by ``seed``, those of the network's noise too; None changes nothing."""
        super().set_random_seed(seed)
        self._seed_noise(seed)

    def _seed_noise(self, seed: int | None) -> None:
        if seed is not None and hasattr(self, "policy"):  # SB3 seeds before it builds the policy
            self.policy.motor_network.noise.seed(seed)

    def _tell_normalization(self) -> None:
        """Warn where observations will not be normalized as those were that the model was trained on."""
        other = other_normalization(self.normalized_observations, self._vec_normalize_env)
        if self.env is not None and other:
            warnings.warn(other, stacklevel=3)

    @classmethod
    def constructor_arguments(
        cls, hyperparameters: Mapping[str, Any], timesteps: int, n_envs: int, n_actions: int
    ) -> dict[str, Any]:
        """Translate a configuration's hyperparameters into arguments of the constructor.

        A subclass translates those of its own whose name or form is another one in configurations, which hold nothing
        but numbers, and hands the others on.

        Args:
            hyperparameters: the algorithm's section of a configuration, such as ``ppo:``.
            timesteps: steps of the whole training, over all environments.
            n_envs: number of environments.
            n_actions: number of muscles.
        """
        arguments = dict(hyperparameters)
        arguments["learning_rate"] = linear_schedule(arguments["learning_rate"], arguments.pop("final_learning_rate"))
        return arguments

    def _setup_model(self) -> None:
        if not isinstance(self.observation_space, spaces.Box):
            name = type(self).__name__
            raise ValueError(
                f"{name} needs observations in a Box, not {self.observation_space}: flatten them, as by "
                "gymnasium.wrappers.FlattenObservation."
            )
        self.action_traces = checked_decays(self.action_traces)  # a saved model has them in a list
        self._check_attributes()
        self.policy_kwargs = _of_as_many_arms(self.policy_kwargs, self.env)
        if isinstance(self.action_space, spaces.Box):  # the policy refuses any other
            self._traces = ActionTraces(self.action_traces, get_action_dim(self.action_space))
        super()._setup_model()  # type: ignore[safe-super]
        self._seed_noise(self.seed)
        self._mix = np.array(stream_mix(self.loss), dtype=np.float32)  # (n_streams, 2)
        self._shares = policy_shares(self.loss)
        # Walking through a policy costs a millisecond, so it is done once.
        self._groups = self.parameter_groups()
        self._network_groups = self.policy.motor_network.parameter_groups()
        if self.policy.n_streams != len(self._mix):
            raise ValueError(
                f"the loss {self.loss!r} needs {len(self._mix)} critics, but the policy has {self.policy.n_streams}: "
                "a saved model keeps its loss, and policy_kwargs leave n_streams out."
            )
        if self.policy.n_traces != len(self.action_traces):
            raise ValueError(
                f"action_traces has {len(self.action_traces)} decays, but the policy's critics see "
                f"{self.policy.n_traces} traces: a saved model keeps its traces, and policy_kwargs leave n_traces out."
            )
        self._freeze()
        self._set_rates()
        for optimizer in self._optimizers_of_policy():
            load_separated(optimizer, self._ids_of_critics())
        self._built_with = {name: getattr(self, name) for name in (*self.FIXED, "learning_rate")}

    def _freeze(self) -> None:
        """Let the frozen groups of the network take no gradient, so that no loss, penalty or projection moves them.

        Raises:
            ValueError: a group that the network has not, or nothing left to learn.
        """
        groups, architecture = self._network_groups, self.policy.motor_network.architecture
        if missing := [name for name in self.frozen if not groups[name]]:
            raise ValueError(f"frozen names {missing[0]}, and a {architecture} network has no such parameters.")
        if self.frozen and not any(group for name, group in groups.items() if name not in self.frozen):
            raise ValueError(f"frozen leaves nothing of a {architecture} network to learn: give fewer groups.")
        for name in self.frozen:
            for parameter in groups[name]:
                parameter.requires_grad_(False)

    def _check_attributes(self) -> None:
        """Refuse what cannot work, of the constructor's arguments, ``load``'s, and attributes that were set since."""
        for name, default in _STATE_DEPENDENT_EXPLORATION.items():
            if vars(self).get(name, default) != default:
                raise ValueError(f"state-dependent exploration ({name}) is not available; leave it out.")
        vars(self).update(checked({name: v for name, v in vars(self).items() if name in self.CHECKS}, self.CHECKS))

    def _setup_learn(
        self,
        total_timesteps: int,
        callback: MaybeCallback = None,
        reset_num_timesteps: bool = True,
        tb_log_name: str = "run",
        progress_bar: bool = False,
    ) -> tuple[int, BaseCallback]:
        self._check_attributes()
        for name in self.FIXED:
            if getattr(self, name) != self._built_with[name]:
                raise ValueError(
                    f"the model was built with {name}={self._built_with[name]!r}, and setting {name} afterwards does "
                    "not rebuild it: give it to the constructor."
                )
        if self.learning_rate != self._built_with["learning_rate"]:
            self._built_with["learning_rate"] = self.learning_rate
            self._setup_lr_schedule()
        self._set_rates()
        if reset_num_timesteps or self._last_obs is None or self._last_traces is None:
            assert self.env is not None
            self._last_traces = self._traces.start(self.env.num_envs)
        self._tell_normalization()
        prepared = super()._setup_learn(total_timesteps, callback, reset_num_timesteps, tb_log_name, progress_bar)
        self._check_policy()
        assert isinstance(self._last_obs, np.ndarray)
        check_observations(self._last_obs, self.num_timesteps)
        self.normalized_observations = self._vec_normalize_env is not None and self._vec_normalize_env.norm_obs
        return prepared

    def _trace(self, actions: NDArray[np.floating], dones: NDArray[np.bool_]) -> NDArray[np.float32]:
        """Take in the actions (n_envs, n_actions) of a step, each number scaled to [-1, 1].

        Returns:
            The traces after it (n_envs, n); where it ended a trial, the next step begins with new ones.
        """
        assert self._last_traces is not None
        if not self.action_traces:
            return self._last_traces
        after = self._traces.advance(self._last_traces, actions.reshape(len(actions), -1))
        self._last_traces = np.where(dones[:, None], np.float32(0), after)
        return after

    def _excluded_save_params(self) -> list[str]:
        return [
            *super()._excluded_save_params(),
            "_traces",
            "_mix",
            "_shares",
            "_groups",
            "_network_groups",
            "_built_with",
        ]

    def _buffer_arguments(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return ``given`` further arguments of the buffer, with those that follow from the algorithm's own.

        Raises:
            ValueError: one of these is given, and another than the algorithm's, or one that SB3 gives.
        """
        if from_algorithm := sorted(_OF_BUFFERS & set(given)):
            raise ValueError(f"{from_algorithm[0]} of the buffer follows from the algorithm: leave it out.")
        own = {"n_streams": len(stream_mix(self.loss)), "action_traces": tuple(self.action_traces)}
        for name, value in own.items():
            other = given.get(name, value)
            if (tuple(other) if isinstance(other, list) else other) != value:  # a saved model has them in a list
                raise ValueError(
                    f"{name} of the buffer follows from the algorithm, {value}, and is given as {other}: leave it out; "
                    "a saved model keeps its traces and its loss."
                )
        return dict(given) | own

    # --- what cannot be learned from ----------------------------------------------------------------------------------

    def _check_policy(self) -> None:
        """Raise DivergedError unless all that is trained is finite, as every ``learn`` begins and every update ends."""
        check_policy((parameter for group in self._groups.values() for parameter in group), self.num_timesteps)

    def _check_actions(self, actions: NDArray[np.floating[Any]]) -> None:
        """Raise DivergedError unless ``actions`` (n_envs, …) are finite."""
        check_actions(actions, (p for group in self._groups.values() for p in group), self.num_timesteps)

    # --- rewards ----------------------------------------------------------------------------------------------------

    def _stream_rewards(
        self, given: RewardPairs, rewards: NDArray[np.float32], without: VecNormalize | None = None
    ) -> NDArray[np.float32]:
        """Return the scaled rewards (…, n_envs, n_streams) of the last step, or of the last steps.

        Args:
            given: their pairs.
            rewards: (…, n_envs), what ``step`` returned.
            without: what normalizes rewards, and shall not have done so to those returned here.

        Raises:
            ValueError: the mean of a pair is not the reward.
        """
        streams = given.normalized(given.pairs @ self._mix.T, without)  # (…, n_envs, 2) @ (2, n_streams)
        agreement = given.agreement(rewards)
        if not agreement.all():
            if self.loss != "combined" or not np.isfinite(rewards).all():
                given.refuse(rewards, self.num_timesteps)
            # The mean of the pair is all that it learns by, and somebody has made another one of it.
            outer = rewards if without is None else without.get_original_reward()
            streams = np.where(agreement[..., None], streams, outer[..., None])
        return np.asarray(streams * self.reward_scale, dtype=np.float32)

    # --- updates ----------------------------------------------------------------------------------------------------

    def _update_learning_rate(self, optimizers: list[torch.optim.Optimizer] | torch.optim.Optimizer) -> None:
        """Set the present learning rate, ``critic_rate_factor`` times as large for critics, and the network's ε."""
        super()._update_learning_rate(optimizers)
        self._set_rates()

    def _set_rates(self) -> None:
        """Give critics their learning rate, and whatever is no critic's the network's ε."""
        critics = self._ids_of_critics()
        rate = self.critic_rate_factor * self.lr_schedule(self._current_progress_remaining)
        for optimizer in self._optimizers_of_policy():
            if self.critic_rate_factor != 1 or self.network_epsilon is not None:
                separate(optimizer, critics)
            set_rates(optimizer, critics, rate, self.network_epsilon)

    def _ids_of_critics(self) -> set[int]:
        groups = self._groups.items()
        return {id(parameter) for name, group in groups if name.startswith("critic_") for parameter in group}

    @abstractmethod
    def _optimizers_of_policy(self) -> list[torch.optim.Optimizer]:
        """Return what optimizes network and critics: one optimizer, or one for each."""

    def parameter_groups(self) -> dict[str, list[nn.Parameter]]:
        """Return every trained parameter by owner: the network's three groups, then ``critic_0``, ``critic_1``, …."""
        return self.policy.parameter_groups()

    def _route(
        self, losses: Sequence[Tensor], groups: Mapping[str, Sequence[nn.Parameter]], scales: Sequence[float]
    ) -> None:
        """Set the gradient of every parameter of ``groups`` from the streams' losses, and the weight penalty's.

        The penalty is a term of the paper's loss. What scales the rest of a stream's loss must scale it too: left as it
        is beside small losses, it shrinks the hemisphere that pays it before that has learned anything.

        Args:
            losses: one scalar per stream, of one graph.
            groups: the parameters of each owner.
            scales: for each stream, the size of its loss's gradient by the network, in that of the mean reward's.
        """
        assign_routed_gradients(losses, groups, self._shares)
        penalties = group_penalties(self.loss, scales, self.penalty_weights)
        add_weight_penalty(self._network_groups, penalties, self.weight_penalty)

    # --- logs -------------------------------------------------------------------------------------------------------

    def _update_info_buffer(self, infos: list[dict[str, Any]], dones: NDArray[np.bool_] | None = None) -> None:
        name_stream_returns(infos)
        super()._update_info_buffer(infos, dones)

    def _log_stream_returns(self) -> None:
        assert self.ep_info_buffer is not None
        record_stream_returns(self.logger, self.ep_info_buffer)

    def _log_averages(self, log: Log) -> None:
        record_averages(self.logger, log, stream_names(self.loss))
        record_combination(self.logger, self.policy.motor_network)
        self.logger.record("train/n_updates", self._n_updates, exclude="tensorboard")


def _warn_of_no_penalty(loss: Loss, weight_penalty: float, weights: Sequence[float], stacklevel: int) -> None:
    """Warn of a penalty that no loss weighs; its default says nothing."""
    if weight_penalty not in (0.0, _USUAL_PENALTY) and not any(group_penalties(loss, None, weights).values()):
        warnings.warn(
            f"weight_penalty={weight_penalty:g} has no effect: the penalty weighs nothing in loss={loss!r} by "
            f"penalty_weights={tuple(weights)}; leave it out, or give weights.",
            stacklevel=stacklevel,
        )


def _of_as_many_arms(policy_kwargs: dict[str, Any], env: VecEnv | None) -> dict[str, Any]:
    """Return arguments of a policy with the number of arms that the environment tells, if it tells of two.

    Raises:
        ValueError: another number is given.
    """
    told = env.get_attr("n_arms")[0] if env is not None and env.has_attr("n_arms") else None
    given = policy_kwargs.get("n_arms")
    if told not in (1, 2):  # it has no arms, or other ones
        return policy_kwargs
    if given is not None and given != told:
        raise ValueError(
            f"policy_kwargs say n_arms={given}, and the environment has {told}: leave n_arms out, or take the "
            "environment of another task."
        )
    return policy_kwargs | ({"n_arms": told} if told > 1 else {})
