"""A reward that is always zero: its side's weight penalty stays in proportion to what the other side learns."""

import gymnasium
import numpy as np
import pytest
import torch
from hemispheric_models import make_model

from bilateral_rl.algorithms import HemisphericA2C, HemisphericPPO, HemisphericSAC, HemisphericTD3
from bilateral_rl.algorithms.stream_scale import penalty_scales
from bilateral_rl.envs import VectorReward


def test_the_penaltys_scales_are_as_they_are_unless_one_is_out_of_proportion():
    for scales, expected in (([0.3, 7.0], [0.3, 7.0]), ([1e8], [1e8]), ([1e8, 0.5], [50.0, 0.5])):
        assert penalty_scales(torch.tensor(scales)) == pytest.approx(expected)


@pytest.mark.filterwarnings("ignore:You have specified a mini-batch size")
@pytest.mark.parametrize("algorithm", [HemisphericPPO, HemisphericA2C, HemisphericSAC, HemisphericTD3])
def test_a_stream_without_a_reward_does_not_blow_up_its_weight_penalty(algorithm):
    env = VectorReward(gymnasium.make("Pendulum-v1"), lambda step: (step.reward, 0.0))
    off_policy = algorithm in (HemisphericSAC, HemisphericTD3)
    normalized = {"normalize_streams" if off_policy else "normalize_advantage": True}
    # Critics of nothing: their errors are what a stream without a reward looks like, and here there are none.
    model = make_model(algorithm, env=env, gamma=0.0, weight_penalty=0.1, **normalized)
    with torch.no_grad():
        for parameter in model.policy.parameter_groups()["critic_1"]:
            parameter.zero_()
    seen, route = [], model._route
    model._route = lambda losses, groups, scales: seen.append(list(scales)) or route(losses, groups, scales)
    model.learn(60)
    ratios = [np.divide(*scales) for scales in seen]
    assert seen
    assert max(max(ratios), 1 / min(ratios)) == pytest.approx(100)
    network = model.policy.motor_network.state_dict()
    assert all(torch.isfinite(tensor).all() for tensor in network.values())
