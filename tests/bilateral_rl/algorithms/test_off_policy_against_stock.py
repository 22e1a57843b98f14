"""Where nothing is specialized, HemisphericSAC and HemisphericTD3 end with stock SAC's and TD3's weights."""

import numpy as np
import pytest
import torch
from hemispheric_models import (
    STOCK,
    EqualStreams,
    LearnedFeatures,
    RandomEnds,
    TwoArms,
    arm,
    assert_close_weights,
    make_model,
    weights,
)
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.vec_env import DummyVecEnv

from bilateral_rl.algorithms import HemisphericSAC, HemisphericTD3

OWN_FEATURES = {"features_extractor_class": LearnedFeatures}
SHARED_FEATURES = OWN_FEATURES | {"share_features_extractor": True}
CASES = {
    "SAC": (HemisphericSAC, {}, {}),
    "SAC with a given temperature": (HemisphericSAC, {"ent_coef": 0.2, "gamma": 0.9}, {}),
    "SAC with three critics": (HemisphericSAC, {"ent_coef": "auto_0.1", "target_entropy": -3.0}, {"n_critics": 3}),
    "SAC with learned features": (HemisphericSAC, {}, OWN_FEATURES),
    "SAC with shared features": (HemisphericSAC, {}, SHARED_FEATURES),
    "TD3": (HemisphericTD3, {}, {}),
    "TD3 with delay": (HemisphericTD3, {"policy_delay": 3, "target_policy_noise": 0.5, "target_noise_clip": 0.3}, {}),
    "TD3 with one critic": (HemisphericTD3, {"tau": 0.3, "gamma": 0.9}, {"n_critics": 1}),
    "TD3 with learned features": (HemisphericTD3, {}, OWN_FEATURES),
    "TD3 with shared features": (HemisphericTD3, {}, SHARED_FEATURES),
}
# A temperature, one critic or learned features are the same for one stream and for two.
IN_TWO_STREAMS = ["SAC", "SAC with three critics", "SAC with shared features"]
IN_TWO_STREAMS += ["TD3", "TD3 with delay", "TD3 with shared features"]


def equal_streams():
    return EqualStreams(arm())


def random_ends():
    return DummyVecEnv([RandomEnds] * 4)


def repeat_critics(policy):
    """Makes every further stream's critics, and their targets, the first stream's."""
    for critic in (policy.critic, policy.critic_target):
        for i in range(policy.n_critics, len(critic.q_networks)):
            critic.q_networks[i].load_state_dict(critic.q_networks[i % policy.n_critics].state_dict())


def assert_trainings_end_alike(algorithm, policy, loss, env, settings, policy_kwargs):
    """Ours and the stock algorithm, from the same weights and random states, after one update and after several."""
    # Without momentum a difference of gradients that Adam would hide shows.
    arguments = {
        "learning_rate": 0.01,
        "learning_starts": 20,
        "policy_kwargs": {"optimizer_class": torch.optim.SGD} | policy_kwargs,
    }
    ours, stock = (
        make_model(a, policy, env(), **(arguments | settings | of_the_class))
        for a, of_the_class in ((algorithm, {"loss": loss, "weight_penalty": 0.0}), (STOCK[algorithm], {}))
    )
    repeat_critics(ours.policy)
    state = ours.policy.state_dict()
    stock.policy.load_state_dict({name: state[name].clone() for name in stock.policy.state_dict()})
    start = weights(stock)
    for seed, steps, updates in ((0, 32, 1), (1, 112, 1 + 6)):
        for model in (ours, stock):
            model.set_random_seed(seed)
            model.learn(steps)
            assert model._n_updates == updates
        assert_close_weights(ours, stock)
    still = [name for name, value in weights(stock).items() if torch.equal(value, start[name])]
    # SB3 gives the targets their extractors at the start, and lets SAC's shared one stay there.
    assert not [name for name in still if "features_extractor" not in name]
    return ours


@pytest.mark.parametrize(
    ("case", "policy", "loss"),
    [
        *[(case, "CallosalPolicy", "combined") for case in CASES],
        *[(case, "UnilateralPolicy", "specialized") for case in IN_TWO_STREAMS],
        ("SAC", "CallosalPolicy", "specialized"),
        ("TD3", "CallosalPolicy", "specialized"),
    ],
)
def test_equal_streams_train_to_the_stock_weights(case, policy, loss):
    algorithm, settings, policy_kwargs = CASES[case]
    ours = assert_trainings_end_alike(algorithm, policy, loss, equal_streams, settings, policy_kwargs)
    if loss == "specialized":
        networks = [[p.detach() for p in critic.parameters()] for critic in ours.policy.critic.q_networks]
        for i in range(ours.policy.n_critics):
            for first, second in zip(networks[i], networks[i + ours.policy.n_critics], strict=True):
                torch.testing.assert_close(second, first, rtol=0, atol=1e-6)


@pytest.mark.parametrize("algorithm", [HemisphericSAC, HemisphericTD3])
def test_one_stream_trains_to_the_stock_weights_where_trials_end_by_termination_and_by_time(algorithm):
    noise = {"action_noise": NormalActionNoise(np.zeros(2), np.full(2, 0.1))}
    assert_trainings_end_alike(algorithm, "BilateralPolicy", "combined", random_ends, noise, {})


@pytest.mark.parametrize("algorithm", [HemisphericSAC, HemisphericTD3])
def test_adams_moments_are_the_stock_ones(algorithm):
    adam = {"optimizer_class": torch.optim.Adam}
    assert_trainings_end_alike(algorithm, "CallosalPolicy", "combined", equal_streams, {"learning_rate": 3e-4}, adam)


@pytest.mark.parametrize("algorithm", [HemisphericSAC, HemisphericTD3])
def test_one_stream_trains_to_the_stock_weights_on_two_arms(algorithm):
    arms = {"n_arms": 2, "units": 8, "trained_combination": True}
    assert_trainings_end_alike(algorithm, "CallosalPolicy", "combined", lambda: DummyVecEnv([TwoArms] * 4), {}, arms)
