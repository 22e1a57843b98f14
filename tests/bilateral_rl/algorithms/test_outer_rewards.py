"""Every algorithm learns by the outermost pair of rewards, whose mean the reward is, or refuses."""

import numpy as np
import pytest
import torch
from gymnasium.wrappers import NormalizeReward, RecordEpisodeStatistics, TransformReward
from hemispheric_models import ALGORITHMS, N_STEPS, OFF_POLICY, arm, collect, make_model
from known_pairs import (
    Anew,
    KnownPairs,
    OwnAttribute,
    OwnPair,
    OwnPairOnly,
    OwnRewardWrapper,
    Passing,
    Swapped,
    half,
    known_pairs,
    two,
)
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import (
    SubprocVecEnv,
    VecCheckNan,
    VecFrameStack,
    VecMonitor,
    VecNormalize,
    VecTransposeImage,
)

from bilateral_rl.envs import VectorReward, VecVectorReward

pytestmark = [
    pytest.mark.filterwarnings("ignore:The environment is already wrapped with a `Monitor`"),
    pytest.mark.filterwarnings("ignore:You have specified a mini-batch size"),
    pytest.mark.parametrize("algorithm", ALGORITHMS),
]


def doubled(env):
    return TransformReward(env, lambda reward: 2 * reward)


def double_pair(step):
    return 2 * step.info["vector_reward"]


def doubled_with_its_pair(env):
    return VectorReward(doubled(env), double_pair)


def three_to_one(env):
    """``VecVectorReward`` whose first reward is three times as large."""
    return VecVectorReward(env, lambda step: np.array([info["vector_reward"] for info in step.info]) * (3, 1))


SAME, DOUBLE, HALF, TENFOLD, ONE_SIDE = (1, 1), (2, 2), (0.5, 0.5), (10, 10), (3, 1)
TRAINS = {
    "nothing": (two, SAME, np.inf),
    "Monitor": (lambda: two(Monitor), SAME, np.inf),
    "RecordEpisodeStatistics": (lambda: two(RecordEpisodeStatistics), SAME, np.inf),
    "VecMonitor": (lambda: VecMonitor(two(Monitor)), SAME, np.inf),
    "VecCheckNan": (lambda: VecCheckNan(two(), raise_exception=True), SAME, np.inf),
    "VecFrameStack": (lambda: VecFrameStack(two(), 3), SAME, np.inf),
    "VecTransposeImage": (lambda: VecTransposeImage(two(shape=(36, 36, 3))), SAME, np.inf),
    "an own wrapper that passes on": (lambda: Passing(two()), SAME, np.inf),
    "VecNormalize of observations": (lambda: VecNormalize(two(), norm_reward=False), SAME, np.inf),
    "VecNormalize": (lambda: half(two()), HALF, 1.5),
    "VecNormalize of rewards": (lambda: half(two(), norm_obs=False), HALF, 1.5),
    "VecNormalize in VecMonitor": (lambda: VecMonitor(half(two())), HALF, 1.5),
    "VecNormalize around VecFrameStack": (lambda: half(VecFrameStack(two(), 2)), HALF, 1.5),
    "VecNormalize twice": (lambda: half(half(two())), (0.25, 0.25), 0.75),
    "VectorReward around TransformReward": (lambda: two(doubled_with_its_pair), DOUBLE, np.inf),
    "an own pair in infos": (lambda: OwnPair(two()), TENFOLD, np.inf),
    "an own pair in infos, then SB3's": (lambda: VecMonitor(VecCheckNan(OwnPair(two()))), TENFOLD, np.inf),
    "VecVectorReward": (lambda: three_to_one(two()), ONE_SIDE, np.inf),
    "VecVectorReward around an own pair in infos": (
        lambda: three_to_one(OwnPair(two())),
        (30, 10),
        np.inf,
    ),
    "VecNormalize around VecVectorReward": (lambda: half(three_to_one(two())), (1.5, 0.5), 1.5),
    "VecMonitor around VecVectorReward": (lambda: VecMonitor(three_to_one(two())), ONE_SIDE, np.inf),
    "VecNormalize around an own pair in infos": (lambda: half(OwnPair(two())), (5, 5), 1.5),
    "an own last_vector_reward": (lambda: OwnAttribute(two()), ONE_SIDE, np.inf),
    "an own last_vector_reward, then SB3's": (lambda: VecMonitor(half(OwnAttribute(two()))), (1.5, 0.5), 1.5),
    "an own wrapper around VecVectorReward": (lambda: Passing(three_to_one(two())), ONE_SIDE, np.inf),
    "an own pair in infos around VecVectorReward": (lambda: OwnPair(three_to_one(two())), (30, 10), np.inf),
    "VecVectorReward around TransformReward": (lambda: three_to_one(two(doubled)), ONE_SIDE, np.inf),
    "an own wrapper around an own last_vector_reward": (lambda: Passing(OwnAttribute(two())), ONE_SIDE, np.inf),
    "an own pair in infos around one": (lambda: OwnAttribute(OwnPair(two())), (30, 10), np.inf),
}
"""Environments, by how much they change each side's reward, and the bound to which they clip half of it."""
REFUSES = {
    "TransformReward": lambda: two(doubled),
    "NormalizeReward": lambda: two(NormalizeReward),
    "an own RewardWrapper": lambda: two(OwnRewardWrapper),
    "TransformReward around VectorReward": lambda: two(lambda env: doubled(VectorReward(env, double_pair))),
    "VecNormalize around TransformReward": lambda: half(two(doubled)),
    "a pair that is not the reward's": lambda: OwnPairOnly(two()),
}


def learned_from(model):
    """(n_steps, n_envs, n_streams): the rewards that updates see."""
    if type(model) not in OFF_POLICY:
        return model.rollout_buffer.rewards
    return model._normalized(torch.from_numpy(model.replay_buffer.rewards[:N_STEPS])).numpy()


def outer_rewards(model):
    """What ``step`` returns from now on, as a list that grows."""
    seen, step = [], model.env.step_wait

    def step_wait():
        result = step()
        seen.append(result[1].copy())
        return result

    model.env.step_wait = step_wait
    return seen


@pytest.mark.parametrize(("make", "factor", "bound"), TRAINS.values(), ids=TRAINS)
def test_it_learns_by_the_outer_pair(algorithm, make, factor, bound):
    model = make_model(algorithm, env=make(), reward_scale=0.5)
    rewards = outer_rewards(model)
    learned = learned_from(collect(model))
    expected = 0.5 * known_pairs(N_STEPS, factor=factor)
    np.testing.assert_allclose(learned, expected.clip(-bound, bound), rtol=1e-5)
    if (np.abs(expected) < bound).all():
        np.testing.assert_allclose(learned.mean(axis=2), 0.5 * np.stack(rewards), rtol=1e-5)


@pytest.mark.parametrize("loss", ["specialized", "dominant"])
@pytest.mark.parametrize("make", REFUSES.values(), ids=REFUSES)
def test_what_leaves_the_pair_as_it_was_is_refused(algorithm, make, loss):
    model = make_model(algorithm, env=make(), loss=loss)
    with pytest.raises(
        ValueError, match=r"the reward of environment [01] is .* Put bilateral_rl.envs.VectorReward around"
    ):
        model.learn(40)
    assert model._n_updates == 0


@pytest.mark.parametrize("make", REFUSES.values(), ids=REFUSES)
def test_the_combined_loss_learns_by_the_reward_itself(algorithm, make):
    model = make_model(algorithm, env=make(), loss="combined")
    rewards = outer_rewards(model)
    np.testing.assert_allclose(learned_from(collect(model))[..., 0], np.stack(rewards), rtol=1e-5)


def test_the_arms_pair_is_passed_by_wrappers_and_outdone_by_one(algorithm):
    """``ArmVecEnv`` has its pair beside infos that are empty."""

    class TimesTen(Passing):
        def step_wait(self):
            observations, rewards, dones, infos = self.venv.step_wait()
            for info, pair in zip(infos, self.venv.last_vector_reward, strict=True):
                info["vector_reward"] = 10 * pair
            return observations, 10 * rewards, dones, infos

    learned = [
        learned_from(collect(make_model(algorithm, env=wrap(arm(2)), gamma=0.0)))
        for wrap in (Passing, TimesTen, lambda env: VecMonitor(Passing(TimesTen(env))))
    ]
    assert np.abs(learned[0]).max() > 0
    for outer in learned[1:]:
        np.testing.assert_allclose(outer, 10 * learned[0], rtol=1e-5)


def test_two_sources_of_which_none_is_the_outer_one_are_refused(algorithm):
    model = make_model(algorithm, env=Passing(Swapped(two())))
    with pytest.raises(ValueError, match="are different pairs of rewards of the same mean, and nothing says which"):
        model.learn(40)


@pytest.mark.parametrize(("wrapper", "factor"), [(OwnAttribute, ONE_SIDE), (Anew, TENFOLD)])
def test_a_pair_that_is_given_outside_of_normalization_is_normalized_by_nobody(algorithm, wrapper, factor):
    model = make_model(algorithm, env=wrapper(half(two(), norm_obs=False)))
    if algorithm in OFF_POLICY:
        with pytest.raises(ValueError, match="put VecNormalize around that wrapper"):
            model.learn(40)
    else:
        np.testing.assert_allclose(learned_from(collect(model)), known_pairs(N_STEPS, factor=factor))


def test_processes(algorithm):
    env = SubprocVecEnv([KnownPairs, KnownPairs], start_method="fork")
    try:
        learned = learned_from(collect(make_model(algorithm, env=env)))
    finally:
        env.close()
    np.testing.assert_allclose(learned, known_pairs(N_STEPS))
