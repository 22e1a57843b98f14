"""The rewards of a training step: the pair of the outermost who gives one, if its mean is what ``step`` returned.

A pair of rewards travels beside the reward that is its mean. Wrappers know of the one or of the other, so that what one
of them does to the reward may not have reached the pair. Nothing is trained on then, but where it can be meant.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, NoReturn

import gymnasium
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.type_aliases import GymEnv
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecNormalize

from bilateral_rl.reward_pair import checked_pairs

Float32 = NDArray[np.float32]

_ATTRIBUTE, _KEY = "last_vector_reward", "vector_reward"
_HALF = np.full(2, 0.5, dtype=np.float32)
_ROUNDING = 1e-4
"""Largest difference between a reward and the mean of its pair, in the sum of the pair's sizes."""


class RewardPairs(NamedTuple):
    """Pairs of rewards as their source gave them, of one step of ``n`` environments, or of several steps."""

    pairs: Float32
    """(n, 2), or (n_steps, n, 2)."""
    normalizers: tuple[VecNormalize, ...] = ()
    """Those around the source that normalize rewards, from the innermost out."""

    def normalized(self, rewards: Float32, without: VecNormalize | None = None) -> Float32:
        """Return ``rewards`` of the source's, of any shape, as its normalizers leave them, all but one."""
        for normalizer in self.normalizers:
            if normalizer is not without:
                rewards = normalizer.normalize_reward(rewards)
        return rewards

    def agreement(self, rewards: Float32) -> NDArray[np.bool_]:
        """Return whether each pair's mean is the reward that ``step`` returned, (n,) or (n_steps, n).

        Nothing agrees with what is not finite.
        """
        means = self.pairs @ _HALF
        equal: NDArray[np.bool_] = means == rewards
        if equal.all() and not self.normalizers:
            return equal
        sizes = np.abs(self.normalized(self.pairs))
        close: NDArray[np.bool_] = np.abs(self.normalized(means) - rewards) <= _ROUNDING * sizes.sum(axis=-1)
        return close

    def refuse(self, rewards: Float32, last_step: int) -> NoReturn:
        """Raise the ValueError that says why the pairs do not agree with ``rewards``, for the first that do not.

        Args:
            rewards: (n,) or (n_steps, n).
            last_step: number of the last step of the training, over all environments.
        """
        *row, number = np.argwhere(~self.agreement(rewards))[0].tolist()
        n_steps, n = (1, *rewards.shape)[-2:]
        step = last_step - (n_steps - 1 - (row[0] if row else 0)) * n
        reward, mean = rewards[(*row, number)], self.normalized(self.pairs @ _HALF)[(*row, number)]
        if not np.isfinite(reward):
            raise ValueError(f"environment {number} gave the reward {reward} at step {step}: it must be finite.")
        raise ValueError(
            f"the reward of environment {number} is {reward:.6g} at step {step}, but the mean of its pair of rewards "
            f"is {mean:.6g}: the hemispheres learn by the pair, and what changes the reward must change it too. Put "
            "bilateral_rl.envs.VectorReward around the wrapper that changes the reward, or VecVectorReward around a "
            "VecEnvWrapper that does, with a function of the step that gives the pair (step.reward is the changed "
            "reward, step.info['vector_reward'] the pair before); a factor on both is reward_scale, and "
            "VecNormalize(norm_reward=True) scales both alike."
        )


def gives_pairs(env: VecEnv) -> bool:
    """Whether the outermost source of pairs is the environment or wrapper itself, by ``last_vector_reward``."""
    return hasattr(type(env), _ATTRIBUTE) and getattr(env, _ATTRIBUTE, None) is not None


def own_pairs(env: VecEnv, step: int) -> Float32:
    """Return the pairs (n_envs, 2) of the last step of an environment that :func:`gives_pairs`.

    Raises:
        ValueError: what is no pair of finite numbers for each environment.
    """
    whose = f"at step {step}, {_ATTRIBUTE} of {type(env).__name__}"
    return checked_pairs(getattr(env, _ATTRIBUTE), env.num_envs, whose)


def outermost_pairs(env: VecEnv, infos: Sequence[Mapping[str, Any]], rewards: Float32, step: int) -> RewardPairs:
    """Return the pairs of the last step, from their outermost source.

    Sources are ``last_vector_reward`` (n_envs, 2) of the environment or of a wrapper, and ``info["vector_reward"]``
    (2,), which the environments or a wrapper may have put there.

    Args:
        env: the environment with all its wrappers.
        infos: what its last step returned.
        rewards: likewise, (n_envs,).
        step: number of that step, for errors.

    Raises:
        ValueError: there is none, there are two of which none is the outer one, or what is no pair.
    """
    normalizers: list[VecNormalize] = []
    is_foreign, layer = False, env  # whether a layer further out may have put pairs into infos
    while not _has_pairs(layer) and isinstance(layer, VecEnvWrapper):
        is_foreign |= not _is_sb3s(layer)
        if isinstance(layer, VecNormalize) and layer.norm_reward:
            normalizers.append(layer)
        layer = layer.venv
    around, has_pairs = tuple(reversed(normalizers)), _has_pairs(layer)
    if has_pairs and not (is_foreign and any(_KEY in info for info in infos)):
        return RewardPairs(own_pairs(layer, step), around)
    by_info = RewardPairs(_pairs_of_infos(infos, step), around)
    if not is_foreign:
        return by_info
    candidates = [by_info, by_info._replace(normalizers=())]  # a wrapper may have put them there around a normalizer
    if has_pairs and isinstance(layer, VecEnvWrapper):  # whatever is not one has no wrapper within to fill infos
        candidates.insert(0, RewardPairs(own_pairs(layer, step), around))
    return _one_of(candidates, rewards)


def _one_of(candidates: Sequence[RewardPairs], rewards: Float32) -> RewardPairs:
    """Return the pairs that agree with the rewards (n,) of the outermost wrapper, or the first if none do.

    Raises:
        ValueError: different pairs that do.
    """
    agreeing = [each for each in candidates if each.agreement(rewards).all()]
    for other in agreeing[1:]:
        if not np.array_equal(other.pairs, agreeing[0].pairs):
            raise ValueError(
                f"{_ATTRIBUTE} of a wrapper and info['{_KEY}'] are different pairs of rewards of the same mean, and "
                f"nothing says which is the outer one: let the outermost wrapper have {_ATTRIBUTE} (n_envs, 2)."
            )
    return (*agreeing, *candidates)[0]


def check_one_reward(env: GymEnv) -> None:
    """Refuse environments whose reward is a vector, as those of MO-Gymnasium, with nothing around that changes it.

    Raises:
        ValueError: such an environment, or such ones in a ``DummyVecEnv``.
    """
    for each in getattr(env, "envs", [env]):
        layer = each
        while isinstance(layer, gymnasium.Wrapper) and _passes_reward(layer):
            layer = layer.env
        shape = getattr(getattr(layer, "reward_space", None), "shape", ())
        if not isinstance(layer, gymnasium.Wrapper) and shape not in ((), (1,), None):
            raise ValueError(
                f"the reward of the environment is a vector of shape {shape}: wrap it in "
                "bilateral_rl.envs.VectorReward, which takes two rewards for the pair, or makes a pair of any "
                "by a function of the step."
            )


def _passes_reward(wrapper: gymnasium.Wrapper[Any, Any, Any, Any]) -> bool:
    known = type(wrapper).__module__.startswith(("gymnasium.", "stable_baselines3."))
    return known and not isinstance(wrapper, gymnasium.RewardWrapper)


def _has_pairs(layer: VecEnv) -> bool:
    """Whether this environment or wrapper gives pairs by itself, and not what it wraps."""
    if _ATTRIBUTE in vars(layer) or hasattr(type(layer), _ATTRIBUTE) or not isinstance(layer, VecEnvWrapper):
        return getattr(layer, _ATTRIBUTE, None) is not None
    return False


def _is_sb3s(layer: VecEnv) -> bool:
    return type(layer).__module__.startswith(("stable_baselines3.", "sb3_contrib."))


def _pairs_of_infos(infos: Sequence[Mapping[str, Any]], step: int) -> Float32:
    pairs = [info.get(_KEY) for info in infos]
    if missing := [number for number, pair in enumerate(pairs) if pair is None]:
        whose = "" if len(missing) == len(infos) else f" of environment {missing[0]}"
        raise ValueError(
            f"a pair of rewards is needed, dominant and non-dominant: the environment has neither {_ATTRIBUTE} "
            f"(n_envs, 2) nor info['{_KEY}']{whose} (2,); wrap it in bilateral_rl.envs.VectorReward."
        )
    return checked_pairs(pairs, len(infos), f"at step {step}, info['{_KEY}']")
