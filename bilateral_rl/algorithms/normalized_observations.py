"""Whether observations are normalized by ``VecNormalize`` as those were that a model was trained on."""

from __future__ import annotations

from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecNormalize


def other_normalization(trained: bool | None, normalizer: VecNormalize | None) -> str | None:
    """Return what differs, and what to do about it, in a sentence; None where nothing does.

    Args:
        trained: whether the model was trained on normalized observations; None if that is not known yet.
        normalizer: the ``VecNormalize`` of its present environment, if that has one.
    """
    if trained is None:
        return None
    normalizes = normalizer is not None and normalizer.norm_obs
    if trained and not normalizes:
        lost = "its environment does not: wrap it by VecNormalize.load(file, env), of the file that env.save wrote"
    elif trained and _is_new(normalizer):
        lost = "its environment begins with no statistics: load those of before by VecNormalize.load(file, env)"
    elif normalizes and not trained:
        lost = "its environment does: wrap it by VecNormalize(env, norm_obs=False), or not at all"
    else:
        return None
    return f"the model was{'' if trained else ' not'} trained on normalized observations, and {lost}."


def _is_new(normalizer: VecNormalize | None) -> bool:
    """Whether it has seen no observation yet."""
    return normalizer is not None and isinstance(normalizer.obs_rms, RunningMeanStd) and normalizer.obs_rms.count < 1
