"""The brain: networks, their lesions and parameter groups, and stable-baselines3 policies around them.

Importing this package lets stock ``PPO``, ``A2C``, ``SAC`` and ``TD3`` take the policies by name:
"UnilateralPolicy", "BilateralPolicy", "CallosalPolicy".
"""

from stable_baselines3 import A2C, PPO, SAC, TD3

from bilateral_rl.policies.actor_critic import (
    BilateralActorCriticPolicy,
    BilateralPolicy,
    CallosalPolicy,
    UnilateralPolicy,
)
from bilateral_rl.policies.lesions import LESIONS, Lesion
from bilateral_rl.policies.motor_network import MotorNetwork
from bilateral_rl.policies.motor_policy import MotorPolicy
from bilateral_rl.policies.networks import (
    ARCHITECTURES,
    BilateralNetwork,
    CallosalNetwork,
    UnilateralNetwork,
    make_network,
)
from bilateral_rl.policies.off_policy import SAC_ALIASES, TD3_ALIASES, BilateralSACPolicy, BilateralTD3Policy
from bilateral_rl.vocabulary import GROUPS

POLICY_ALIASES: dict[str, type[BilateralActorCriticPolicy]] = {
    policy.__name__: policy for policy in (UnilateralPolicy, BilateralPolicy, CallosalPolicy)
}

for _algorithms, _aliases in (((PPO, A2C), POLICY_ALIASES), ((SAC,), SAC_ALIASES), ((TD3,), TD3_ALIASES)):
    for _algorithm in _algorithms:
        _algorithm.policy_aliases = _algorithm.policy_aliases | _aliases  # type: ignore[operator]

__all__ = [
    "ARCHITECTURES", "GROUPS", "LESIONS", "POLICY_ALIASES", "SAC_ALIASES", "TD3_ALIASES", "BilateralActorCriticPolicy",
    "BilateralNetwork", "BilateralPolicy", "BilateralSACPolicy", "BilateralTD3Policy", "CallosalNetwork",
    "CallosalPolicy", "Lesion", "MotorNetwork", "MotorPolicy", "UnilateralNetwork", "UnilateralPolicy", "make_network",
]  # fmt: skip
