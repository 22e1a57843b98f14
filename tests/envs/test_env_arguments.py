"""Every argument of every environment, of its settings and of its arm: another value shows, or is refused."""

import dataclasses
import inspect

import gymnasium
import numpy as np
import pytest
import torch
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv

from bilateral_rl import envs
from bilateral_rl.envs import (
    Arm,
    ArmEnv,
    ArmParameters,
    ArmVecEnv,
    ArmVectorEnv,
    SpringSettings,
    TrialSettings,
    TwoArmSettings,
    VectorReward,
    VecVectorReward,
)
from bilateral_rl.envs.losses import LossSettings, SideLoss
from bilateral_rl.envs.tasks import make_task
from bilateral_rl.envs.trials import TrialBatch
from bilateral_rl.vocabulary import SIDES

N, STEPS = 48, 12
LOADED = {"task": "hold_position"}


def rollout(task="hold_position", **settings):
    """Everything that arms show of their trials under random actions, to the last step and what follows it."""
    settings = {"trial_length": STEPS} | settings
    venv = ArmVecEnv(N, task, seed=0, **settings)
    muscles = venv.action_space.shape[0]
    actions = np.random.default_rng(0).uniform(-1, 1, (STEPS, N, muscles)).astype(np.float32)
    shown = [venv.reset()]
    for action in actions:
        observations, rewards, _, infos = venv.step(action)
        shown += [observations, rewards]
    measures = [[info.get(name) for name in ("is_success", "time_in_goal", "final_error")] for info in infos]
    return b"".join(array.tobytes() for array in shown), repr(measures)


# Settings and the arm

OTHER_SETTINGS = {
    "trial_length": STEPS - 1,
    "threshold": 0.3,
    "max_load": 5.0,
    "load": "direction",
    "sensory_noise": 0.01,
    "motor_noise": 0.01,
    "feedback_delay": 1,
    "length_noise": 0.01,
    "velocity_noise": 0.01,
    "vision_noise": 0.01,
    "proprioception_delay": 1,
    "vision_delay": 1,
    "losses": LossSettings(last_steps=3),
    "arm": ArmParameters(timestep=0.005),
}
OTHER_PARAMETERS = {
    "joint_lower_limit": (0.1, 0.1),
    "min_activation": 0.01,
    "path_linear_shoulder": (-0.03, 0.03, 0.01, 0.0, -0.03, 0.03),
    "path_quadratic_shoulder": (0.01,) * 6,
    "path_reference_angle": (1.0, 0.1),
    "low_activation_origin": 0.1,
}
"""Other values, where a tenth more would not do."""


def a_tenth_more(value):
    return tuple(1.1 * number for number in value) if isinstance(value, tuple) else 1.1 * value


def test_every_setting_shows():
    of_one_arm = {field.name for field in dataclasses.fields(TrialSettings)} - {"two_arms"}
    assert OTHER_SETTINGS.keys() == of_one_arm
    plain = rollout()
    assert plain == rollout(), "or nothing is shown below"
    for name, value in OTHER_SETTINGS.items():
        assert rollout(**{name: value}) != plain, name


OTHER_SPRINGS = {"stiffness": 60.0, "damping": 1.0, "kind": "distance"}
OTHER_PAIRS = {
    "shoulder_distance": 0.4,
    "spring": {"stiffness": 0.0},
    "roles": "dominant_reaches",
    "reach": (0.05, 0.2),
}


def test_every_setting_of_two_arms_shows():
    for cls, others in ((TwoArmSettings, OTHER_PAIRS), (SpringSettings, OTHER_SPRINGS)):
        assert others.keys() == {field.name for field in dataclasses.fields(cls)}
    plain = rollout("reach_and_hold")
    for changed in (*({name: value} for name, value in OTHER_PAIRS.items()),
                    *({"spring": {name: value}} for name, value in OTHER_SPRINGS.items())):  # fmt: skip
        assert rollout("reach_and_hold", two_arms=changed) != plain, changed


def test_every_weight_of_a_loss_shows_but_that_of_the_weight_penalty():
    plain = rollout()
    for side in SIDES:
        for field in dataclasses.fields(SideLoss):
            default = getattr(LossSettings(), side)
            changed = dataclasses.replace(default, **{field.name: getattr(default, field.name) + 0.5})
            shows = rollout(losses=LossSettings(**{side: changed})) != plain
            assert shows == (field.name != "penalty"), field.name


def test_a_mapping_of_weights_changes_the_papers_loss_and_a_side_loss_is_the_whole_of_it():
    paper = LossSettings()
    added = LossSettings(dominant={"hand_speed": 0.1}).dominant
    assert added == dataclasses.replace(paper.dominant, hand_speed=0.1)
    assert LossSettings(dominant=SideLoss(hand_speed=0.1)).dominant.cartesian_2 == 0
    assert LossSettings(dominant={}, non_dominant={}) == paper


def test_every_parameter_of_the_arm_shows():
    plain = rollout()
    for field in dataclasses.fields(ArmParameters):
        value = OTHER_PARAMETERS.get(field.name, a_tenth_more(field.default))
        assert rollout(arm=ArmParameters(**{field.name: value})) != plain, field.name


def test_settings_of_a_load_are_refused_by_environments_without_one():
    for make in (ArmEnv, lambda **settings: ArmVecEnv(2, **settings), lambda **settings: ArmVectorEnv(2, **settings)):
        for setting in ({"max_load": 3.0}, {"load": "direction"}):
            make(task="hold_position", **setting)
            (name,) = setting
            with pytest.raises(ValueError, match=f"^{name} has no effect on random_reach, whose trials have no load: "):
                make(task="random_reach", **setting)
        make(task="random_reach", max_load=10.0, load="axes")
    with pytest.raises(ValueError, match="max_load has no effect"):
        gymnasium.make("bilateral_rl/RandomReach-v0", max_load=3.0)


def test_settings_of_a_load_may_stand_in_settings_for_several_tasks():
    settings = TrialSettings(max_load=3.0)
    for task in ("random_reach", "hold_position"):
        assert TrialBatch(make_task(task), settings, 1).settings == settings


# Constructors


def shows(env):
    """The first observation, the first step's, and what is said of the environment."""
    n = (env.num_envs,) if isinstance(env, VecEnv) else ()
    reset = env.reset() if isinstance(env, VecEnv) else env.reset(seed=0)
    step = env.step(np.zeros((*n, *env.action_space.shape), dtype=np.float32))
    return repr((reset, step, env.render_mode, env.metadata, env.observation_space, env.action_space))


def pairs(value):
    return lambda transition: (value, -value)


def pendulums(**arguments):
    venv = DummyVecEnv([lambda: gymnasium.make("Pendulum-v1", **arguments)] * 2)
    venv.seed(0)
    return venv


CONSTRUCTORS = {
    ArmEnv: {"task": "hold_position", "render_mode": "rgb_array", "settings": {"arm": {"timestep": 0.005}}},
    ArmVecEnv: {
        "n_envs": 3,
        "task": "hold_position",
        "render_mode": "rgb_array",
        "seed": 1,
        "settings": {"sensory_noise": 0.1},
    },
    ArmVectorEnv: {
        "num_envs": 3,
        "task": "hold_position",
        "render_mode": "rgb_array",
        "autoreset_mode": "NextStep",
        "settings": {"sensory_noise": 0.1},
    },
    VectorReward: {"env": lambda: gymnasium.make("Pendulum-v1", g=5.0), "reward_pair": pairs(2.0)},
    VecVectorReward: {"venv": lambda: pendulums(g=5.0), "reward_pairs": pairs(2.0)},
}
"""Other values of each argument."""
PLAIN = {
    ArmEnv: {},
    ArmVecEnv: {"n_envs": 2, "seed": 0},
    ArmVectorEnv: {"num_envs": 2},
    VectorReward: {"env": lambda: gymnasium.make("Pendulum-v1"), "reward_pair": pairs(1.0)},
    VecVectorReward: {"venv": lambda: pendulums(), "reward_pairs": pairs(1.0)},
}
ELSEWHERE = {"Arm", "ArmParameters", "Experiment", "ExperimentError", "ExperimentTask", "TrialBatch", "TrialSettings"}
ELSEWHERE |= {"SpringSettings", "TwoArmSettings"}
"""Classes that other tests look at: of this file, of trials in test_doors.py, of experiments in test_experiment*.py."""
DATA = {
    "ArmState",
    "Transition",
    "Trials",
    "Task",
    "HoldPosition",
    "RandomReach",
    "ReachAndHold",
    "TwoHolds",
    "TwoReaches",
}
"""Classes without a constructor of their own: tuples of arrays, and tasks, which take no arguments."""


def test_every_public_class_is_looked_at():
    public = {name for name in envs.__all__ if inspect.isclass(getattr(envs, name))}
    assert public == {cls.__name__ for cls in CONSTRUCTORS} | ELSEWHERE | DATA


def built(cls, arguments):
    arguments = {name: v() if name in ("env", "venv") else v for name, v in (PLAIN[cls] | arguments).items()}
    return cls(**arguments)


@pytest.mark.parametrize("cls", CONSTRUCTORS)
def test_every_argument_of_an_environment_shows(cls):
    names = inspect.signature(cls).parameters.keys()
    assert names - {"device"} == CONSTRUCTORS[cls].keys(), "say here what another value changes"
    plain = shows(built(cls, {}))
    assert plain == shows(built(cls, {})), "or nothing is shown below"
    for name, value in CONSTRUCTORS[cls].items():
        assert shows(built(cls, value if name == "settings" else {name: value})) != plain, name
    if "device" in names:
        for device in ("nowhere", "cuda:99"):
            with pytest.raises((ValueError, RuntimeError), match=device):
                built(cls, {"device": device})
        assert shows(built(cls, {"device": torch.device("cpu")})) == plain


def test_every_argument_of_an_arm_shows():
    assert inspect.signature(Arm).parameters.keys() == {"parameters", "device", "dtype"}

    def after(**arguments):
        arm = Arm(**arguments)
        state = arm.rest(torch.tensor([[0.5, 1.0]], dtype=arm.dtype))
        return repr(arm.step(state, torch.full((1, 6), 0.5, dtype=arm.dtype)))

    assert after(parameters=ArmParameters(timestep=0.005)) != after()
    assert after(dtype=torch.float64) != after()
    with pytest.raises((ValueError, RuntimeError), match="nowhere"):
        Arm(device="nowhere")
