"""A features extractor sees in training what it sees in acting, whatever the shape of observations."""

import numpy as np
import pytest
import torch
from gymnasium import spaces
from gymnasium.wrappers import FrameStackObservation, TimeLimit, TransformReward
from hemispheric_models import ALGORITHMS, OFF_POLICY, STOCK, make_model
from known_pairs import KnownPairs, Passing, two
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack, VecNormalize

from bilateral_rl.envs import ArmEnv, VectorReward

pytestmark = pytest.mark.filterwarnings("ignore:You have specified a mini-batch size")
EVERY = [*ALGORITHMS, *STOCK.values()]


class Seen(BaseFeaturesExtractor):
    """Sums of the observation's columns; keeps what it is given."""

    given: list[tuple[bool, torch.Tensor]]

    def __init__(self, observation_space):
        super().__init__(observation_space, features_dim=observation_space.shape[-1])
        self.given = []

    def forward(self, obs):
        self.given.append((self.training, obs.detach().clone()))
        return obs.sum(dim=tuple(range(1, obs.ndim - 1)))


ENVIRONMENTS = {
    "stacked arms": (lambda: FrameStackObservation(ArmEnv(trial_length=7), 4), (4, 16)),
    "an image": (lambda: KnownPairs((1, 36, 36)), (1, 36, 36)),
    "one number a row": (lambda: KnownPairs((5, 1)), (5, 1)),
}


@pytest.mark.parametrize("algorithm", EVERY)
@pytest.mark.parametrize(("make", "shape"), ENVIRONMENTS.values(), ids=ENVIRONMENTS)
def test_training_sees_what_acting_saw(algorithm, make, shape):
    model = make_model(
        algorithm, env=DummyVecEnv([make] * 2), policy_kwargs={"features_extractor_class": Seen}, **small(algorithm)
    ).learn(80)
    extractors = [module for module in model.policy.modules() if isinstance(module, Seen)]
    given = [each for extractor in extractors for each in extractor.given]
    assert all(obs.shape[1:] == shape for _, obs in given)
    acted, trained = (
        {row.numpy().tobytes() for training, obs in given if training is wanted for row in obs}
        for wanted in (False, True)
    )
    assert len(acted) > 70
    assert len(trained) > 40
    # Off-policy, the last observation of an episode is trained on and never acted on.
    assert len(trained - acted) <= (0 if hasattr(model, "rollout_buffer") else 80 / 7 + 2)
    action, _ = model.predict(model.env.reset(), deterministic=True)
    assert np.isfinite(action).all()


def small(algorithm):
    return {"learning_starts": 20} if hasattr(algorithm, "load_replay_buffer") else {"n_steps": 20}


class Shifted(Passing):
    """Changes observations."""

    def reset(self):
        return self.venv.reset() + 1

    def step_wait(self):
        observations, *rest = self.venv.step_wait()
        return observations + 1, *rest


@pytest.mark.parametrize("wrap", [Shifted, lambda env: VecFrameStack(env, 2)], ids=["own", "VecFrameStack"])
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_what_changes_normalized_observations(algorithm, wrap):
    """A replay buffer has what ``VecNormalize`` was given; PPO and A2C store what they act on."""
    model = make_model(algorithm, env=wrap(VecNormalize(two())))
    if algorithm in OFF_POLICY:
        with pytest.raises(ValueError, match="a wrapper around VecNormalize changes observations"):
            model.learn(80)
    else:
        model.learn(80)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_misspelt_policy_is_told_the_names_there_are(algorithm):
    with pytest.raises(ValueError, match=r"has no policy 'CallosumPolicy'; choose from .*CallosalPolicy"):
        algorithm("CallosumPolicy", "Pendulum-v1")


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_other_spaces_are_refused_in_a_sentence(algorithm):
    class Choosing(KnownPairs):
        action_space = spaces.Discrete(3)

    class Named(KnownPairs):
        def __init__(self):
            self.observation_space = spaces.Dict({"a": spaces.Box(-1.0, 1.0, (3,))})

        def reset(self, *, seed=None, options=None):
            return {"a": np.zeros(3, np.float32)}, {}

    for env in (Choosing(), DummyVecEnv([Choosing])):
        with pytest.raises(ValueError, match=r"continuous actions in a bounded Box, not Discrete\(3\): wrap"):
            make_model(algorithm, env=env)
    with pytest.raises(ValueError, match=r"needs observations in a Box, not Dict.*flatten them, as by gymnasium"):
        make_model(algorithm, env=DummyVecEnv([Named] * 4))


class ManyRewards(KnownPairs):
    """The pair is the reward, as in MO-Gymnasium."""

    reward_space = spaces.Box(-np.inf, np.inf, (2,))

    def step(self, action):
        observation, _, *ends, info = super().step(action)
        return observation, info.pop("vector_reward"), *ends, info


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_vector_of_rewards_needs_to_be_made_a_pair(algorithm):
    for env in (ManyRewards(), TimeLimit(ManyRewards(), 5), DummyVecEnv([ManyRewards])):
        with pytest.raises(ValueError, match=r"is a vector of shape \(2,\): wrap it in bilateral_rl.envs.VectorReward"):
            make_model(algorithm, env=env)
    make_model(algorithm, env=VectorReward(ManyRewards())).learn(60)
    summed = TransformReward(ManyRewards(), lambda pair: float(pair.sum()))
    make_model(algorithm, env=summed)  # one reward; that there is no pair is told when it steps
