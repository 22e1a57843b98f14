"""Every experiment that ships shows its phenomenon, in a network that has only learned to reach from a center."""

from pathlib import Path

import numpy as np
import pytest

from bilateral_rl.analysis import channels
from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.api.run import Run
from bilateral_rl.config.resolve import resolve
from bilateral_rl.envs import ArmVecEnv, TrialSettings, experiment_named, hand_position
from bilateral_rl.envs.body_frame import in_body_frame
from bilateral_rl.envs.task_specs import PARADIGMS
from bilateral_rl.envs.tasks import make_task
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import load_policy
from bilateral_rl.training.run import train

NETWORK = Path(__file__).parents[2] / "data" / "run_center_out"
pytestmark = pytest.mark.usefixtures("no_pictures")


@pytest.fixture(scope="module")
def trials():
    """What the network does in an experiment, maybe changed."""
    policy = load_policy(RunFolder(NETWORK))

    def run(name, **changes):
        config = resolve("bptt", name, [{"experiment": changes}] if changes else [])
        return Evaluator(config.make_task(), config.trial, 48, 2_000_000).run(policy)

    return run


@pytest.fixture(scope="module")
def adapted(tmp_path_factory):
    """The blocks of sixty updates in the curl field."""
    settings = {"init_from": str(NETWORK), "epochs": 1, "bptt": {"trials": 60 * 64}, "threads": 1}
    config = resolve("bptt", "curl_field", [settings | {"blocks": {"every": 20, "trials": 32}}])
    folder = train(config, tmp_path_factory.mktemp("adapted")).folder
    return Run(folder).blocks().set_index(["condition", "block"])


def value(record, metric):
    return find_metric(metric).value(record)


def test_every_experiment_that_ships_is_looked_at_here():
    assert {*PARADIGMS} <= {
        "center_out", "curl_field", "saddle_field", "target_jump", "force_pulse", "delayed_reach",
        "bimanual_reaches", "bimanual_curl_field",
    }  # fmt: skip


def test_center_out_paths_go_straight_to_the_right_targets(trials):
    record = trials("center_out")
    assert value(record, "goal_completion_2cm") == 100
    places = np.unique(record.target.round(4), axis=0)
    assert len(places) == 8
    nearest = np.linalg.norm(record.hand[:, -1, None] - places, axis=2).argmin(axis=1)
    np.testing.assert_allclose(places[nearest], record.target, atol=1e-4)
    assert value(record, "perpendicular_deviation") < 1


def test_a_curl_field_first_pushes_every_reach_to_its_side(trials):
    record = trials("curl_field")
    deviation = channels.largest_deviation(record.hand, record.target)
    # B = b [[0, 1], [-1, 0]] turns a velocity into a force to its right.
    assert (deviation < -0.02).all()
    assert (
        np.abs(channels.largest_deviation(*(getattr(trials("center_out"), x) for x in ("hand", "target")))).max() < 0.02
    )


def test_a_saddle_field_pushes_to_the_side_of_its_force(trials):
    record = trials("saddle_field")
    force = -channels.force_on_walls(record.field_force, record.hand[:, 0], record.target)  # (n, T), to the left
    pushed = force[:, :15].mean(axis=1)
    deviation = channels.deviation_at_peak_speed(record.hand, record.target)
    assert pushed.min() < -1 < 1 < pushed.max(), "unlike a curl field, it pushes to both sides"
    assert np.corrcoef(deviation, pushed)[0, 1] > 0.8


def test_the_error_in_a_curl_field_falls_and_the_after_effect_is_opposite(adapted):
    deviation, n = adapted["signed_deviation"], adapted.index.get_level_values("block").max()
    assert deviation["field", 0] < -3
    assert abs(deviation["field", n]) < 0.6 * abs(deviation["field", 0])
    assert adapted["perpendicular_deviation"]["field", n] < 0.8 * adapted["perpendicular_deviation"]["field", 0]
    assert abs(deviation["null", 0]) < 0.5
    assert deviation["null", n] > 1
    compensation = adapted["channel_compensation"]["channel"].to_numpy()
    assert abs(compensation[0]) < 0.1
    assert compensation[n] > 0.1


def test_the_hand_follows_a_target_that_jumps(trials):
    record = trials("target_jump")
    jumps = record.plan.has("jump")
    assert 0 < jumps.sum() < len(jumps)
    end = record.hand[:, -1]
    to_second, to_first = (np.linalg.norm(end - target, axis=1) for target in (record.target, record.plan.goal))
    assert (to_second[jumps] < to_first[jumps]).all()
    assert to_second.mean() < 0.025
    assert value(record, "goal_completion_2cm") > 95
    latency = value(record, "jump_latency")
    assert 10 < latency < 100, "muscles are slower than a step, and this arm senses without delay"


def test_a_pulse_displaces_the_hand_which_comes_back(trials):
    forces = trials("force_pulse").plan.pulse_force
    assert len(np.unique(forces.round(3), axis=0)) == 9, "eight directions, and none"
    pulse = {"force": {"size": 10, "directions": 8}, "at": 10, "steps": 10}
    pushed, plain = (trials("force_pulse", forces={"pulse": pulse | {"share": share}}) for share in (1.0, 0.0))
    np.testing.assert_array_equal(pushed.hand[:, :11], plain.hand[:, :11])
    away = pushed.hand - plain.hand
    direction = pushed.plan.pulse_force / 10
    assert ((away[:, 20] * direction).sum(axis=1) > 0.005).all()
    size = np.linalg.norm(away, axis=2)
    assert size[:, -1].mean() < 0.25 * size.max(axis=1).mean()
    assert value(pushed, "goal_completion_2cm") == 100


def test_nothing_is_known_of_the_target_before_the_cue(trials):
    record = trials("delayed_reach")
    go, cued = record.plan.go, record.plan.go < record.hand.shape[1]
    assert 0 < cued.sum() < len(cued)
    earliest = go[cued].min()
    waiting = record.hand[:, : earliest + 1]
    np.testing.assert_array_equal(waiting, waiting[:1].repeat(len(waiting), axis=0))
    assert value(record, "premature_movement") < 2
    assert value(record, "goal_completion_2cm") == 100
    distance = np.linalg.norm(record.hand[:, -1] - record.plan.goal, axis=1)
    assert (distance[cued] < 0.03).all()
    assert (distance[~cued] > 0.08).all(), "without a cue the hand stays"
    assert 10 <= value(record, "reaction_time") < 100


def test_hands_that_reach_together_go_in_parallel_or_as_in_a_mirror():
    task = make_task("bimanual_reaches")
    settings = TrialSettings(**task.trial)
    trials = task.trials(np.random.default_rng(0).random((200, task.n_uniform)), settings)
    start, goal = (in_body_frame(hand_position(of, settings.arm), 0.36) for of in (trials.start, trials.goal))
    dominant, other = np.moveaxis((goal - start).round(4), 1, 0)
    np.testing.assert_allclose(np.linalg.norm([dominant, other], axis=2), 0.1, atol=1e-4)
    parallel, mirrored = (dominant == other).all(axis=1), (dominant * [-1, 1] == other).all(axis=1)
    assert (parallel | mirrored).all()
    assert len({tuple(row) for row in np.hstack([dominant, other]).tolist()}) == 6
    assert 0.2 < (parallel & ~mirrored).mean() < 0.47 > (mirrored & ~parallel).mean() > 0.2


def test_a_curl_field_on_each_hand_pushes_mirrored_movements_to_mirrored_sides():
    experiment, ends = experiment_named("bimanual_curl_field"), {}
    command = np.random.default_rng(0).uniform(-1, 1, (1, 6)).astype(np.float32)
    for condition in ("field", "null"):
        env = ArmVecEnv(1, experiment.with_condition(condition), seed=0)
        env.reset()
        for _ in range(15):
            env.step(np.hstack([command, command]))
        ends[condition] = env.batch.hand  # of both hands, each in its own arm's frame
        np.testing.assert_array_equal(ends[condition][0], ends[condition][1])
    moved, pushed = ends["null"][0] - [0, 0.4], ends["field"][0] - ends["null"][0]
    assert np.linalg.norm(moved) > 0.05
    # To the right of the dominant hand's movement: a turn from the movement to the push that is clockwise.
    assert moved[0] * pushed[1] - moved[1] * pushed[0] < 0
    assert np.linalg.norm(pushed) > 0.01


@pytest.mark.slow
def test_rewards_adapt_the_same_network(tmp_path):
    config = resolve("ppo", "curl_field", [{"init_from": str(NETWORK)}])
    blocks = Run(train(config, tmp_path).folder).blocks().set_index(["condition", "block"])
    deviation, n = blocks["signed_deviation"], blocks.index.get_level_values("block").max()
    assert abs(deviation["field", n]) < 0.7 * abs(deviation["field", 0])
    assert deviation["null", n] > 2
    assert blocks.loc[("channel", n), "channel_compensation"] > 0.3
