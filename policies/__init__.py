"""The brain: networks, their lesions and parameter groups, and stable-baselines3 policies around them.

Importing this package lets stock ``PPO`` and ``A2C`` take the policies by name: "UnilateralPolicy",
"BilateralPolicy", "CallosalPolicy".
"""

from stable_baselines3 import A2C, PPO

from bilateral_rl.policies.actor_critic import (
    BilateralActorCriticPolicy,
    BilateralPolicy,
    CallosalPolicy,
    UnilateralPolicy,
)
from bilateral_rl.policies.lesions import LESIONS, Lesion
from bilateral_rl.policies.motor_policy import MotorPolicy
from bilateral_rl.policies.networks import (
    ARCHITECTURES,
    GROUPS,
    BilateralNetwork,
    CallosalNetwork,
    MotorNetwork,
    UnilateralNetwork,
    make_network,
)

POLICY_ALIASES: dict[str, type[BilateralActorCriticPolicy]] = {
    policy.__name__: policy for policy in (UnilateralPolicy, BilateralPolicy, CallosalPolicy)
}

for _algorithm in (PPO, A2C):
    _algorithm.policy_aliases = _algorithm.policy_aliases | POLICY_ALIASES  # type: ignore[assignment]

__all__ = [
    "ARCHITECTURES", "GROUPS", "LESIONS", "POLICY_ALIASES", "BilateralActorCriticPolicy", "BilateralNetwork",
    "BilateralPolicy", "CallosalNetwork", "CallosalPolicy", "Lesion", "MotorNetwork", "MotorPolicy",
    "UnilateralNetwork", "UnilateralPolicy", "make_network",
]  # fmt: skip
