"""The constructors: SB3's arguments and defaults, each documented and passed on, and in a sentence what is refused."""

import inspect
import re
from unittest.mock import ANY

import pytest
from hemispheric_models import ALGORITHMS, OFF_POLICY, ON_POLICY, STOCK, arm, make_model
from stable_baselines3.common.buffers import DictRolloutBuffer, ReplayBuffer, RolloutBuffer

from bilateral_rl.algorithms import HemisphericA2C, HemisphericPPO, HemisphericSAC

OURS = {
    "loss": "specialized", "weight_penalty": 0.001, "reward_scale": 1.0, "action_traces": (), "frozen": (),
    "penalty_weights": (0.0, 2.0), "critic_rate_factor": 1.0, "network_epsilon": None,
}  # fmt: skip
OURS_OFF_POLICY = OURS | {"critic_warm_up": 0, "standardize_inputs": False, "normalize_streams": False}
OF_SAC = {"policy_delay": 1}
"""The arguments that hemispheric algorithms have besides SB3's, with their defaults."""

each_algorithm = pytest.mark.parametrize("algorithm", ALGORITHMS)


def parameters(algorithm):
    return dict(inspect.signature(algorithm).parameters)


@each_algorithm
def test_the_arguments_and_their_defaults_are_sb3s_and_a_few_more(algorithm):
    """Fails for a version of SB3 that has another argument or default: take it over."""
    ours = {name: p.default for name, p in parameters(algorithm).items()}
    sb3 = {name: p.default for name, p in parameters(STOCK[algorithm]).items()}
    more = OURS_OFF_POLICY | {"actor_value": ANY} if algorithm in OFF_POLICY else OURS
    more = more | OF_SAC if algorithm is HemisphericSAC else more
    assert ours == sb3 | more
    assert [name for name in ours if name not in more] == list(sb3), "in SB3's order"


@each_algorithm
def test_every_argument_is_listed_typed_and_documented(algorithm):
    for name, parameter in parameters(algorithm).items():
        assert parameter.kind not in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL), name
        assert parameter.annotation is not parameter.empty, name
        if name != "_init_setup_model":
            assert re.search(rf"^    {name}: \S", inspect.getdoc(algorithm), re.MULTILINE), f"{name} is not documented"


@pytest.mark.parametrize("algorithm", [HemisphericPPO, HemisphericA2C, HemisphericSAC])
def test_state_dependent_exploration_is_refused(algorithm):
    with pytest.raises(ValueError, match=r"state-dependent exploration \(use_sde\) is not available"):
        make_model(algorithm, use_sde=True)
    for name, value in (("sde_sample_freq", 4), ("use_sde_at_warmup", True)):
        if name in parameters(algorithm):
            with pytest.raises(ValueError, match=name):
                make_model(algorithm, **{name: value})


@pytest.mark.parametrize("algorithm", ON_POLICY)
def test_another_rollout_buffer_is_refused(algorithm):
    with pytest.raises(ValueError, match=f"{algorithm.__name__} needs its own rollout buffer"):
        make_model(algorithm, rollout_buffer_class=DictRolloutBuffer)


@pytest.mark.parametrize("algorithm", ON_POLICY)
def test_models_saved_by_version_0_1_0_name_sb3s_rollout_buffer(algorithm, tmp_path):
    model = make_model(algorithm)
    model.rollout_buffer_class, model.rollout_buffer_kwargs = RolloutBuffer, {}
    model.save(tmp_path / "model")
    loaded = algorithm.load(tmp_path / "model", env=arm(), device="cpu")
    assert loaded.learn(80).rollout_buffer.rewards.shape == (20, 4, 2)


@pytest.mark.parametrize("algorithm", OFF_POLICY)
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"replay_buffer_class": ReplayBuffer}, "needs its own replay buffer: leave replay_buffer_class out"),
        ({"n_steps": 3}, "has no returns of several steps: leave n_steps out"),
        ({"optimize_memory_usage": True}, "keeps next observations: leave optimize_memory_usage out"),
    ],
)
def test_other_experience_than_single_steps_of_streams_is_refused(algorithm, arguments, message):
    with pytest.raises(ValueError, match=message):
        make_model(algorithm, **arguments)
