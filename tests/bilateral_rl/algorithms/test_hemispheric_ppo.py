"""HemisphericPPO: epochs that end early, minibatches, and its log of clipping."""

import numpy as np
import pytest
from hemispheric_models import ROLLOUT, collect, learn_logged, make_model
from stable_baselines3 import PPO

from bilateral_rl.algorithms import HemisphericPPO


def count_optimizer_steps(model):
    steps = []
    model.policy.optimizer.register_step_post_hook(lambda *_: steps.append(1))
    model.learn(ROLLOUT)
    return len(steps)


def test_target_kl_stops_an_update_early():
    settings = {"n_epochs": 10, "learning_rate": 0.03}
    assert count_optimizer_steps(make_model(HemisphericPPO, **settings)) == 20
    assert 0 < count_optimizer_steps(make_model(HemisphericPPO, target_kl=0.01, **settings)) < 20
    assert count_optimizer_steps(make_model(HemisphericPPO, target_kl=1e6, **settings)) == 20


def test_an_epoch_that_target_kl_cuts_short_counts_as_stock_ppo_counts_it():
    settings = {"n_epochs": 10, "learning_rate": 0.03, "target_kl": 0.0}
    ours = make_model(HemisphericPPO, "UnilateralPolicy", loss="combined", **settings).learn(ROLLOUT)
    stock = make_model(PPO, "UnilateralPolicy", **settings).learn(ROLLOUT)
    assert ours._n_updates == stock._n_updates == 1


def test_the_logged_clip_fraction_and_divergence_are_those_of_the_updates():
    logged = learn_logged(make_model(HemisphericPPO, n_epochs=1, batch_size=ROLLOUT, clip_range=0.1))
    assert logged["train/clip_range"] == [0.1, 0.1]
    # Before the one step of an update the policy is the one that collected.
    assert logged["train/clip_fraction"] == [0.0, 0.0]
    np.testing.assert_allclose(logged["train/approx_kl"], 0.0, atol=1e-6)
    logged = learn_logged(make_model(HemisphericPPO, n_epochs=10, learning_rate=0.03, clip_range=0.1))
    assert 0 < min(logged["train/clip_fraction"]) < max(logged["train/clip_fraction"]) < 1
    assert min(logged["train/approx_kl"]) > 1e-4


def test_a_rollout_that_is_no_multiple_of_the_minibatch_is_used_to_its_end():
    with pytest.warns(UserWarning, match="mini-batch"):
        model = collect(make_model(HemisphericPPO, batch_size=60, n_epochs=1))
    assert [len(batch.returns) for batch in model.rollout_buffer.get(60)] == [60, 20]
    assert count_optimizer_steps(model) == 2


def test_the_schedules_of_its_clipping_are_saved(tmp_path):
    make_model(HemisphericPPO, clip_range=0.3, clip_range_vf=0.4).save(tmp_path / "model.zip")
    loaded = HemisphericPPO.load(tmp_path / "model.zip", device="cpu")
    assert (loaded.clip_range(1.0), loaded.clip_range_vf(1.0)) == (0.3, 0.4)
