"""HemisphericPPO and HemisphericA2C: a silent stream, clipping by group, and logs."""

import numpy as np
import pytest
import torch
from hemispheric_models import (
    ON_POLICY,
    ROLLOUT,
    WHOLE_ROLLOUT,
    changed,
    collect,
    gradients_of_update,
    learn_logged,
    make_model,
    names_by_group,
    weights,
)

from bilateral_rl.vocabulary import SIDES

pytestmark = pytest.mark.parametrize("algorithm", ON_POLICY)


@pytest.mark.parametrize(
    ("policy", "silenced", "stream"), [("BilateralPolicy", "non_dominant", 1), ("CallosalPolicy", "dominant", 0)]
)
def test_a_stream_without_advantages_moves_no_parameter_of_its_hemisphere(
    monkeypatch, algorithm, policy, silenced, stream
):
    model = make_model(algorithm, policy, weight_penalty=0.0, ent_coef=0.0)
    compute = model.rollout_buffer.compute_returns_and_advantage

    def compute_and_silence(*args):
        compute(*args)
        model.rollout_buffer.advantages[..., stream] = 0.0

    monkeypatch.setattr(model.rollout_buffer, "compute_returns_and_advantage", compute_and_silence)
    before, groups = weights(model), {group: set(names) for group, names in names_by_group(model).items()}
    model.learn(ROLLOUT)
    moved = changed(model, before)
    other = SIDES[1 - stream]
    assert not moved & groups[silenced]
    assert groups[other] <= moved
    assert groups["shared"] <= moved
    assert groups["critic_0"] | groups["critic_1"] <= moved


def test_each_streams_advantages_are_normalized_by_themselves(algorithm):
    model = collect(make_model(algorithm, normalize_advantage=True, reward_scale=0.5))
    (batch,) = model.rollout_buffer.get(ROLLOUT)
    raw, (normalized, scales) = batch.advantages, model._advantages(batch)
    assert (raw[:, 0].std() / raw[:, 1].std() - 1).abs() > 0.1, "the streams were meant to differ"
    torch.testing.assert_close(normalized.mean(dim=0), torch.zeros(2), rtol=0, atol=1e-5)
    torch.testing.assert_close(normalized.std(dim=0), torch.ones(2))
    assert scales == pytest.approx((0.5 / raw.std(dim=0)).tolist())
    model.normalize_advantage = False
    advantages, scales = model._advantages(batch)
    assert torch.equal(advantages, raw)
    assert scales == [0.5, 0.5]


def test_each_group_is_clipped_by_itself_in_an_update(algorithm):
    gradients = []
    for max_grad_norm in (1e9, 0.05):
        settings = WHOLE_ROLLOUT[algorithm] | {"max_grad_norm": max_grad_norm}
        model = collect(make_model(algorithm, **settings))
        torch.manual_seed(1)
        gradients.append(gradients_of_update(model))
    free, clipped = gradients
    for names in names_by_group(model).values():
        norm = torch.linalg.vector_norm(torch.cat([free[name].flatten() for name in names]))
        factor = min(1.0, 0.05 / (norm.item() + 1e-6))
        for name in names:
            torch.testing.assert_close(clipped[name], factor * free[name], rtol=1e-4, atol=1e-8)


def test_gradient_norms_of_every_group_are_logged_before_and_after_clipping(algorithm):
    logged = learn_logged(make_model(algorithm))
    for group in (*SIDES, "shared", "critic_0", "critic_1"):
        before, after = (np.array(logged[f"{name}/{group}"]) for name in ("gradient_norm", "gradient_norm_clipped"))
        assert (after > 0).all()
        assert (after <= 0.5 + 1e-6).all()
        assert (after <= before + 1e-6).all()
    assert {"train/std", "train/ent_coef", *(f"explained_variance/{side}" for side in SIDES)} <= set(logged)
