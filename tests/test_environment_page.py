"""The numbers on the page of the environments are the code's."""

import math
import re
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import bilateral_rl
from bilateral_rl.envs import MUSCLE_NAMES, ArmParameters, TrialSettings
from bilateral_rl.envs.doors import settings_for
from bilateral_rl.envs.measures import STEPS_TO_COMPLETE
from bilateral_rl.envs.task_specs import TASK_SPECS
from bilateral_rl.envs.tasks import make_task
from bilateral_rl.envs.two_arm_tasks import FROM_MIDLINE, IN_FRONT
from bilateral_rl.envs.two_arms import TwoArmSettings
from bilateral_rl.vocabulary import LOSS_WEIGHTS

TEXT = (Path(__file__).parents[1] / "docs" / "environments.md").read_text(encoding="utf-8")
ONE_ARM = {name: spec for name, spec in TASK_SPECS.items() if spec.n_arms == 1}
NAMES = [spec.environment_id for spec in ONE_ARM.values()]


def rows(heading, table=0):
    """The cells of the first table below a heading, or of a later one, without its head."""
    section = re.search(rf"^#+ {heading}\n(.*?)(?=^#|\Z)", TEXT, re.DOTALL | re.MULTILINE)[1]
    tables = re.findall(r"((?:^\|.*\|\n)+)", section, re.MULTILINE)
    lines = re.findall(r"^\|(.*)\|$", tables[table], re.MULTILINE)[2:]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)] for line in lines]


def number(text):
    return float(text.replace("−", "-"))


@pytest.fixture(params=NAMES)
def env(request):
    with gymnasium.make(request.param) as env:
        yield env


def last_step(env, action):
    env.reset(seed=0)
    for step in range(env.unwrapped.settings.trial_length):
        observation, reward, terminated, truncated, info = env.step(action)
        assert (terminated, truncated) == (False, step == 49)
    return observation, reward, info


def test_the_tasks_are_named_and_described():
    table = rows("Environments")
    assert [cell.strip("`") for cell in table[0][1:]] == NAMES
    assert [cell.strip("`") for cell in table[1][1:]] == list(ONE_ARM)
    assert table[2][1:] == [spec.description for spec in ONE_ARM.values()]
    assert [cell.replace(" ", "_") for cell in table[3][1:]] == [spec.judged_by for spec in ONE_ARM.values()]


def test_the_tasks_of_two_arms_are_named_and_described():
    table, specs = rows("Two arms")[:5], {name: spec for name, spec in TASK_SPECS.items() if spec.n_arms == 2}
    assert [cell.strip("`") for cell in table[0][1:]] == [spec.environment_id for spec in specs.values()]
    assert [cell.strip("`") for cell in table[1][1:]] == list(specs)
    assert table[2][1:] == [spec.description for spec in specs.values()]
    assert [cell.replace(" ", "_") for cell in table[3][1:]] == [spec.judged_by for spec in specs.values()]
    springs = [settings_for(make_task(name), {}).two_arms.spring.stiffness for name in specs]
    assert table[4][1:] == [f"{stiffness:g} N/m" for stiffness in springs]


def test_two_arms_have_the_spaces_and_infos_of_the_page():
    low, high = np.full(40, np.nan), np.full(40, np.nan)
    for *indices, _, _, least, greatest in rows("Two arms", table=1):
        for cell in indices:
            first, last = map(int, (cell.split("–") * 2)[:2])
            low[first : last + 1], high[first : last + 1] = number(least), number(greatest)
    with gymnasium.make("bilateral_rl/TwoHolds-v0") as env:
        assert env.action_space == gymnasium.spaces.Box(-1, 1, (12,), np.float32)
        np.testing.assert_allclose(env.observation_space.low, low, rtol=1e-6)
        np.testing.assert_allclose(env.observation_space.high, high, rtol=1e-6)
        _, _, info = last_step(env, np.zeros(12, np.float32))
    for name in ("distance", "speed_to_goal", "time_in_goal", "final_error", "goal_completion"):
        assert f"`{name}`" in TEXT
        assert info[name].shape == (2,)
    assert f"shoulders are {TwoArmSettings().shoulder_distance:g} m apart" in TEXT
    assert f"5 cm from the midline or farther, and at least {100 * IN_FRONT:g} cm in front" in TEXT
    assert FROM_MIDLINE == 0.05
    assert TwoArmSettings().reach == (0.1, 0.2)


def test_actions_are_those_of_the_muscles(env):
    table = rows("Actions")
    assert [(int(row[0]), row[1]) for row in table] == list(enumerate(MUSCLE_NAMES))
    assert env.action_space == gymnasium.spaces.Box(-1, 1, (6,), np.float32)
    moment_arms = zip(ArmParameters().path_linear_shoulder, ArmParameters().path_linear_elbow, strict=True)
    for (_, _, joints, moves), (shoulder, elbow) in zip(table, moment_arms, strict=True):
        assert (
            joints
            == {(True, False): "shoulder", (False, True): "elbow", (True, True): "both"}[bool(shoulder), bool(elbow)]
        )
        assert (moves == "flexes") == (shoulder + elbow < 0)


def test_observations_have_the_bounds_of_the_page(env):
    low, high = np.full(16, np.nan), np.full(16, np.nan)
    for indices, _, _, least, greatest in rows("Observations"):
        first, last = map(int, indices.split("–"))
        low[first : last + 1], high[first : last + 1] = number(least), number(greatest)
    assert env.observation_space.shape == (16,)
    np.testing.assert_allclose(env.observation_space.low, low, rtol=1e-6)
    np.testing.assert_allclose(env.observation_space.high, high, rtol=1e-6)
    assert f"velocity of {ArmParameters().normalized_max_velocity:g} optimal lengths per second" in TEXT


def test_rewards_follow_the_formulas():
    dominant, non_dominant = LOSS_WEIGHTS["dominant"], LOSS_WEIGHTS["non_dominant"]
    (_, first), (_, second) = rows("Rewards")
    assert first == f"−({dominant.cartesian_2:g} · 10 · mean *e*² + {dominant.activation:g} · mean *u*²)"
    assert second == rf"−{non_dominant.cartesian_1:g} · mean \|*e*\|"
    with gymnasium.make(NAMES[0]) as env:
        action = np.linspace(-1, 1, 6, dtype=np.float32)
        observation, reward, info = last_step(env, action)
        error = env.unwrapped.batch.hand[0] - observation[14:]  # (2,)
        excitation = (action + 1) / 2
        pair = [-(50 * np.mean(error**2) + 2 * np.mean(excitation**2)), -5 * np.mean(np.abs(error))]
    np.testing.assert_allclose(info["vector_reward"], pair, rtol=1e-4)
    assert reward == pytest.approx(np.mean(pair), rel=1e-4)


def test_infos_have_the_entries_of_the_page(env):
    _, _, info = last_step(env, np.zeros(6, np.float32))
    table = {row[0].strip("`"): row for row in rows("Info")}
    assert table.keys() <= info.keys()
    assert {key for key, row in table.items() if row[1]} == {"vector_reward", "vector_return"}
    assert all(np.shape(info[key]) == ((2,) if row[1] else ()) for key, row in table.items())
    assert STEPS_TO_COMPLETE == 3


def test_arguments_have_the_defaults_of_the_page():
    defaults = {row[0].strip("`"): row[1].strip("`") for row in rows("Arguments")}
    settings = TrialSettings()
    assert list(defaults) == list(TrialSettings.__dataclass_fields__)
    for name, text in defaults.items():
        value = getattr(settings, name)
        assert text == _written(value)


def _written(value):
    if isinstance(value, str):
        return f'"{value}"'
    is_plain = value is None or isinstance(value, int | float)
    return f"{type(value).__name__}()" if not is_plain else "None" if value is None else f"{value:g}"


def test_ranges_in_words_are_those_of_the_arm():
    shoulder, elbow = (round(math.degrees(limit)) for limit in ArmParameters().joint_upper_limit)
    assert f"shoulder ranges from 0 to {shoulder}°, the elbow from 0 to {elbow}°" in TEXT
    assert f"activation of {ArmParameters().min_activation:g}" in TEXT
    assert f"{sum(ArmParameters().link_length):.3f} m is the length" in TEXT
    assert f"each axis uniform in ±{TrialSettings().max_load:g} N" in TEXT
    assert dict(zip(ONE_ARM, NAMES, strict=True)).items() <= bilateral_rl.envs.ENVIRONMENT_IDS.items()
