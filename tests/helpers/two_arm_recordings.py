"""A recording of two arms, made once: four short trials of a random network that reaches and holds, and its pieces."""

import functools
from dataclasses import asdict
from types import SimpleNamespace

import torch

from bilateral_rl.analysis.conditions import conditions
from bilateral_rl.analysis.recording import Recording
from bilateral_rl.analysis.recording_of_trials import record
from bilateral_rl.config.parse import plain
from bilateral_rl.config.resolve import resolve
from bilateral_rl.policies.lesions import LESIONS, NO_LESION
from bilateral_rl.runs.policies import build_policy

TRIALS, STEPS, SEED = 4, 12, 3


@functools.cache
def two_arms(model="cc_s", lesions=("intact",)):
    """The recording, its policy, and the conditions of its trials."""
    spring = {"stiffness": 50.0, "damping": 2.0}
    config = resolve(
        None, "reach_and_hold", [{"trial": {"trial_length": STEPS, "two_arms": {"spring": spring}}}], model=model
    )
    torch.manual_seed(0)
    policy = build_policy(config)
    with torch.no_grad():
        for parameter in policy.motor_network.parameters():
            if parameter.requires_grad:
                parameter += 0.3 * torch.randn(parameter.shape)
    under = conditions(config)
    by_name = {name: LESIONS.get(name, NO_LESION) for name in lesions}
    metadata = {"run": "somewhere", "settings": plain(asdict(under.settings))}
    parts = record({0: policy}, by_name, under, TRIALS, SEED, metadata)
    return SimpleNamespace(recording=Recording.join(parts), policy=policy, under=under)
