"""What every policy of this package has in common, whatever algorithm trains it."""

from __future__ import annotations

from typing import Any, ClassVar

import torch
from gymnasium import spaces
from stable_baselines3.common.policies import BasePolicy
from torch import nn

from bilateral_rl.policies.networks import MotorNetwork


class MotorPolicy(BasePolicy):
    """A stable-baselines3 policy that acts by one of the paper's networks.

    Attributes:
        NETWORK_KEY: where ``state_dict()`` holds the network: what its names begin with.
        n_streams: reward streams that the critics predict.
    """

    NETWORK_KEY: ClassVar[str]
    n_streams: int

    @property
    def motor_network(self) -> MotorNetwork:
        """The network: lesion it, or load weights trained elsewhere into it."""
        raise NotImplementedError

    def parameter_groups(self) -> dict[str, list[nn.Parameter]]:
        """Every trained parameter of the policy by owner: the network's three groups, then ``critic_0``, …."""
        raise NotImplementedError

    def _use_fused_adam(self) -> None:
        # A small network's update is mostly overhead, of which the fused kernel has a third.
        other_kinds = {"foreach", "differentiable"} & self.optimizer_kwargs.keys()
        if self.optimizer_class is torch.optim.Adam and not other_kinds:
            self.optimizer_kwargs = {"fused": True} | self.optimizer_kwargs

    def _network_optimizer(self) -> torch.optim.Optimizer:
        """What updates the network."""
        raise NotImplementedError

    def _constrain_after_steps(self) -> None:
        # The projection belongs to every update, also those of SB3's own training loops.
        self._network_optimizer().register_step_post_hook(lambda *_: self.motor_network.constrain())

    def __setstate__(self, state: dict[str, Any]) -> None:
        # A copied optimizer has lost its hooks.
        super().__setstate__(state)  # type: ignore[no-untyped-call]
        self._constrain_after_steps()


def check_commands(action_space: spaces.Space[Any], use_sde: bool) -> None:
    """Raise a ValueError for actions that the networks cannot command, or for gSDE."""
    if not isinstance(action_space, spaces.Box) or not action_space.is_bounded():
        raise ValueError(f"the policy commands muscles in a bounded Box, not {action_space}.")
    if use_sde:
        raise ValueError("state-dependent exploration (use_sde) is not available for this policy.")
