"""What every policy of this package has in common, whatever algorithm trains it."""

from __future__ import annotations

from typing import ClassVar

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
