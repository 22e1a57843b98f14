"""The base class of every policy of this package, whatever algorithm trains it."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar

import torch
from gymnasium import spaces
from stable_baselines3.common.policies import BasePolicy
from torch import Tensor, nn

from bilateral_rl.policies.arms import arms_of_spaces
from bilateral_rl.policies.motor_network import MotorNetwork


class MotorPolicy(BasePolicy):
    """A stable-baselines3 policy that acts by one of the paper's networks.

    Attributes:
        NETWORK_KEY: prefix of the network's entries in ``state_dict()``.
        n_streams: number of reward streams that the critics predict.
        n_traces: traces of past actions that the critics see besides the observation.
    """

    NETWORK_KEY: ClassVar[str]
    n_streams: int
    n_traces: int

    @property
    @abstractmethod
    def motor_network(self) -> MotorNetwork:
        """The network: lesion it, or load weights trained elsewhere into it."""

    @abstractmethod
    def parameter_groups(self) -> dict[str, list[nn.Parameter]]:
        """Return every trained parameter by owner: the network's three groups, then ``critic_0``, ``critic_1``, …."""

    def _shape_of_network(self) -> dict[str, Any]:
        """Return the arguments of the policy that say what network it has, as it has been built."""
        arguments = self.motor_network.arguments
        return {name: value for name, value in arguments.items() if name not in ("n_inputs", "n_outputs")}

    def _use_fused_adam(self) -> None:
        """Choose Adam's fused kernel, unless another optimizer or another of its kernels is asked for.

        An update of so small a network is mostly overhead, of which the fused kernel has a third.
        """
        other_kernels = {"foreach", "differentiable"} & self.optimizer_kwargs.keys()
        if self.optimizer_class is torch.optim.Adam and not other_kernels:
            self.optimizer_kwargs = {"fused": True} | self.optimizer_kwargs

    def __setattr__(self, name: str, value: Any) -> None:
        if name == "motor_network":  # torch would keep a module of that name, which nothing uses
            raise AttributeError(
                "the motor network of a policy cannot be replaced; load weights into it, by "
                "policy.motor_network.load_state_dict(other.state_dict())."
            )
        super().__setattr__(name, value)


class Constrained(nn.Module):
    """Mixin of what an optimizer moves a motor network with: after every step, the network projects.

    A hook of the optimizer, and not a line in the algorithms' ``train``, so that updates by SB3's own training loops
    project too; and of whatever optimizer is assigned, so that one of the user's own projects as well.
    """

    @property
    @abstractmethod
    def motor_network(self) -> MotorNetwork:
        """The network."""

    @property
    def optimizer(self) -> torch.optim.Optimizer:
        """What moves the network, and what it is trained with."""
        optimizer: torch.optim.Optimizer = self._optimizer  # type: ignore[assignment] # torch: "a tensor or module"
        return optimizer

    @optimizer.setter
    def optimizer(self, optimizer: torch.optim.Optimizer) -> None:
        self._optimizer = optimizer
        optimizer.register_step_post_hook(lambda *_: self.motor_network.constrain())

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)  # type: ignore[no-untyped-call]
        if "_optimizer" in state:  # which has lost its hooks by being copied
            self.optimizer = state["_optimizer"]


def network_arguments(
    observation_space: spaces.Space[Any], action_space: spaces.Space[Any], n_arms: int | None, **arguments: Any
) -> dict[str, Any]:
    """Return the arguments of a policy that say what network it has, for ``make_network`` beside those of its spaces.

    Raises:
        ValueError: an unbounded or non-Box action space, or no number of arms where the spaces are those of two.
    """
    check_commands(action_space)
    n_arms = arms_of_spaces(n_arms, spaces.flatdim(observation_space), spaces.flatdim(action_space))
    return {"n_arms": n_arms, **arguments}


def check_commands(action_space: spaces.Space[Any]) -> None:
    """Refuse actions that the networks cannot command.

    Raises:
        ValueError: an unbounded or non-Box action space.
    """
    if not isinstance(action_space, spaces.Box) or not action_space.is_bounded():
        raise ValueError(
            f"the policy needs continuous actions in a bounded Box, not {action_space}: wrap the environment so that "
            "it takes them, or choose another."
        )


def check_traces(traces_dim: int, traces: Tensor | None) -> None:
    """Refuse traces of past actions of another size than critics see.

    Raises:
        ValueError: traces (n, traces_dim) that are missing or of another size.
    """
    size = 0 if traces is None else traces.shape[1]
    if size != traces_dim:
        raise ValueError(
            f"the critics of this policy see {traces_dim} numbers of action traces besides observations, got {size}: "
            "train by a hemispheric algorithm with action_traces, and give them to predict_stream_values(obs, traces)."
        )
