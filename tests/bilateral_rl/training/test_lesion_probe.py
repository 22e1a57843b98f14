import random
import shutil
import signal

import numpy as np
import pandas as pd
import pytest
import torch
from stable_baselines3 import A2C, PPO
from stable_baselines3.common.logger import Logger
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.plugins.custom_scalar import layout_pb2

from bilateral_rl.analysis.goals import JUDGED_RADII
from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.analysis.specialization import specialization_index
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.config.parse import merge
from bilateral_rl.config.resolve import resolve
from bilateral_rl.envs import ArmVecEnv
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.figures.specialization_over_training import specialization_over_training
from bilateral_rl.figures.style import new_figure
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import LESIONS
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import load_policy
from bilateral_rl.study.drawing import draw_study
from bilateral_rl.training import lesion_probe
from bilateral_rl.training.fresh_networks import fresh_network
from bilateral_rl.training.lesion_probe import FIGURE, LesionProbe
from bilateral_rl.training.probe_table import PROBE, read_probe, read_probes
from bilateral_rl.training.progress import Progress
from bilateral_rl.training.run import resume, train

pytestmark = pytest.mark.filterwarnings("ignore:You have specified a mini-batch size")

STATES = ["intact", *LESIONS]
PROBED = {
    "task": "hold_position",
    "timesteps": 4_000,
    "n_envs": 20,
    "ppo": {"batch_size": 250},
    "evaluation": {"every": 2_000, "checkpoint_every": 2_000, "trials": 8, "lesion_probe_every": 2_000},
}


def config_with(**values):
    return resolve(None, None, [merge(PROBED, values)])


def steps(table):
    return table.loc[(table["lesion"] == "intact") & (table["network"] == "trained"), "timesteps"].tolist()


def trained(table):
    """Its rows but for the control's."""
    return table[table["network"] == "trained"].drop(columns="network").reset_index(drop=True)


@pytest.fixture(scope="module")
def _probed(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lesion_probe, "is_above", lambda *samples: True)  # so short a training stays at the floor
        return train(config_with(), tmp_path_factory.mktemp("probed")).folder


@pytest.fixture
def probed(_probed, tmp_path):
    """A small finished run with probes, of its own copy."""
    path = tmp_path / "hold_position" / "cc_s-ppo-1"
    shutil.copytree(_probed.path, path)
    return RunFolder(path)


@pytest.fixture
def make_model():
    """Builder of stock algorithms on a few arms, as in a script."""

    def make(policy="BilateralPolicy", n_envs=4, algorithm=PPO, **arguments):
        env = ArmVecEnv(n_envs, "hold_position", seed=0)
        return algorithm(policy, env, n_steps=50, seed=0, device="cpu", **arguments)

    return make


@pytest.fixture
def empty_figures(monkeypatch):
    """Drawing takes longer than all else here."""
    place = "bilateral_rl.figures.specialization_over_training.specialization_over_training"
    monkeypatch.setattr(place, lambda probes, task: new_figure(1.0))


# --- in a run -------------------------------------------------------------------------------------------------------


def test_every_state_is_tested_at_the_start_after_every_k_steps_and_at_the_end(probed):
    table = read_probe(probed.path / PROBE)
    assert list(zip(table["network"], table["timesteps"], table["lesion"], strict=True)) == [
        (network, step, state)
        for network, step in (("fresh", 0), ("trained", 0), ("trained", 2_000), ("trained", 4_000))
        for state in STATES
    ]


def test_the_intact_network_does_what_the_evaluations_say(probed):
    intact = trained(read_probe(probed.path / PROBE)).query("lesion == 'intact'").drop(columns="lesion")
    evaluations = pd.read_csv(probed.path / "evaluations.csv")[list(intact)]
    pd.testing.assert_frame_equal(intact.reset_index(drop=True), evaluations, check_dtype=False)


def test_each_row_is_what_the_network_does_after_that_lesion(probed):
    config = probed.config()
    policy = load_policy(probed)
    evaluator = Evaluator(config.task, config.trial, config.evaluation.trials, config.evaluation.seed)
    rows = (
        trained(read_probe(probed.path / PROBE))
        .query("timesteps == 4000")
        .set_index("lesion")
        .drop(columns="timesteps")
    )
    for state, row in rows.iterrows():
        with policy.motor_network.lesioned(state):
            expected = evaluator.run(policy).summary(config.trial.threshold)
        assert row.to_dict() == pytest.approx(expected, rel=1e-5, nan_ok=True)
    assert len(set(rows["return_dominant"])) == len(STATES)


def test_a_probed_training_ends_with_the_bits_of_one_that_was_not(probed, tmp_path, empty_figures):
    plain = train(config_with(evaluation={"lesion_probe_every": 0}), tmp_path / "plain").folder
    assert not (plain.path / PROBE).exists()
    expected, weights = plain.load_weights("final"), probed.load_weights("final")
    assert expected.keys() == weights.keys()
    assert all(torch.equal(expected[name], weights[name]) for name in expected)


def test_a_probed_off_policy_training_ends_with_the_same_bits_too(tmp_path, empty_figures):
    few = {"learning_starts": 200, "batch_size": 32, "gradient_steps": 1}
    values = {"model": "bi_s", "task": "hold_position", "timesteps": 800, "n_envs": 10, "sac": few}
    weights = []
    for every in (0, 400):
        config = resolve("sac", None, [values | {"evaluation": {"lesion_probe_every": every, "trials": 4}}])
        weights.append(train(config, tmp_path).folder.load_weights("final"))
    assert all(torch.equal(weights[0][name], weights[1][name]) for name in weights[0])


def test_tensorboard_shows_each_state_and_the_specialization_index(probed):
    events = EventAccumulator(str(probed.path), size_guidance={"images": 0, "tensors": 0})
    events.Reload()
    table = trained(read_probe(probed.path / PROBE)).set_index(["timesteps", "lesion"])
    for state in STATES:
        for measure in table:
            shown = [(event.step, event.value) for event in events.Scalars(f"lesions_{measure}/{state}")]
            expected = [(step, table.loc[(step, state), measure]) for step in (0, 2_000, 4_000)]
            np.testing.assert_allclose(shown, expected, rtol=1e-5)
    index = [(event.step, event.value) for event in events.Scalars("specialization/time_in_goal_5cm")]
    for step, value in index:
        dominant_alone = table.loc[(step, "deep_non_dominant"), "time_in_goal_steps"]
        non_dominant_alone = table.loc[(step, "deep_dominant"), "time_in_goal_steps"]
        np.testing.assert_allclose(value, specialization_index(dominant_alone, non_dominant_alone), rtol=1e-4)
    assert [step for step, _ in index] == [0, 2_000, 4_000]
    assert np.isfinite([value for _, value in index]).any()


def test_tensorboard_lays_the_states_of_a_measure_over_each_other(probed):
    events = EventAccumulator(str(probed.path), size_guidance={"tensors": 0})
    events.Reload()
    (event,) = events.Tensors("custom_scalars__config__")
    layout = layout_pb2.Layout.FromString(event.tensor_proto.string_val[0])
    charts = {chart.title: list(chart.multiline.tag) for chart in layout.category[0].chart}
    assert charts["time_in_goal_steps"] == [f"lesions_time_in_goal_steps/{state}$" for state in STATES]


def test_the_figure_lies_in_the_run_and_in_tensorboard(probed):
    assert (probed.path / f"{FIGURE}.png").read_bytes().startswith(b"\x89PNG")
    assert (probed.path / f"{FIGURE}.pdf").read_bytes().startswith(b"%PDF")
    events = EventAccumulator(str(probed.path), size_guidance={"images": 0})
    events.Reload()
    assert [event.step for event in events.Images(f"figures/{FIGURE}")] == [4_000]


def test_a_network_without_hemispheres_trains_without_a_probe_and_says_so(tmp_path):
    outcome = train(config_with(model="uni_b", timesteps=1_000), tmp_path)
    assert not (outcome.folder.path / PROBE).exists()
    assert any("no hemispheres" in note for note in outcome.notes)


class StopAt(Progress):
    def __init__(self, step):
        self._step = step

    def on_step(self, done):
        if done == self._step:
            signal.raise_signal(signal.SIGINT)


def test_a_stopped_and_resumed_training_has_the_rows_of_one_that_never_stopped(probed, tmp_path, empty_figures):
    stopped = train(config_with(), tmp_path / "stopped", StopAt(2_500))
    assert stopped.interrupted
    resume(stopped.folder, config_with())
    assert (stopped.folder.path / PROBE).read_bytes() == (probed.path / PROBE).read_bytes()


def test_rows_after_the_state_that_a_training_goes_on_from_are_made_again(probed, empty_figures):
    table = read_probe(probed.path / PROBE)
    later = table[table["network"] == "trained"]
    later = later.assign(timesteps=later["timesteps"] + 4_001)
    pd.concat([table, later]).to_csv(probed.path / PROBE, index=False)
    resume(probed, config_with(timesteps=6_000))
    resumed = read_probe(probed.path / PROBE)
    assert steps(resumed) == [0, 2_000, 4_000, 6_000]
    pd.testing.assert_frame_equal(resumed[: len(table)], table)


def test_a_damaged_table_is_a_clear_error(probed):
    path = probed.path / PROBE
    sound = path.read_text()
    changes = (("2000", "two"), ("2000", "0"), ("deep_dominant", "deep"), ("timesteps", "steps"))
    for damaged in ("", "nonsense\n1\n", *(sound.replace(*change) for change in changes)):
        path.write_text(damaged)
        with pytest.raises(UserError, match=f"{PROBE} is .*Move it away"):
            resume(probed, config_with(timesteps=6_000))


def test_a_table_that_is_a_link_out_of_the_run_is_not_read(probed, tmp_path):
    shutil.move(probed.path / PROBE, tmp_path / "elsewhere.csv")
    (probed.path / PROBE).symlink_to(tmp_path / "elsewhere.csv")
    with pytest.raises(UserError, match="link out of"):
        read_probe(probed.path / PROBE)


def test_tables_of_runs_come_with_model_and_seed_and_those_without_are_left_out(probed, run):
    table = read_probes([probed, run])
    assert set(table["model"]) == {"cc_s"}
    assert set(table["seed"]) == {0}
    assert len(table) == 4 * len(STATES)
    assert read_probes([run]).empty
    with pytest.raises(UserError, match="seed 0 of cc_s once more"):
        read_probes([probed, probed])


def test_a_study_draws_runs_that_were_probed(probed):
    drawings = {
        d.name: d
        for d in draw_study(pd.DataFrame(columns=list(COLUMNS)), JUDGED_RADII, {"hold_position": {"cc_s": [probed]}})
    }
    figure = drawings["specialization_hold_position_over_training"].figure
    assert [axes.get_title() for axes in figure.axes][:1] == ["CC-S"]


# --- in a script ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n_envs", [2, 8])
def test_probes_come_by_environment_steps_whatever_n_envs_is(make_model, n_envs):
    probe = LesionProbe("hold_position", every=400, trials=2)
    make_model(n_envs=n_envs).learn(1_000 if n_envs == 2 else 1_200, callback=probe)
    assert steps(probe.table) == ([0, 400, 800, 1_000] if n_envs == 2 else [0, 400, 800, 1_200])


def test_a_stock_algorithm_is_probed_without_a_folder(make_model):
    probe = LesionProbe("hold_position", TrialSettings(trial_length=20), every=100, trials=2)
    model = make_model(algorithm=A2C)
    model.learn(400, callback=probe)
    bilateral = [name for name in STATES if "callosum" not in name]
    assert probe.table["lesion"].tolist() == 4 * bilateral
    assert model.policy.motor_network.lesion == LESIONS.get("intact", model.policy.motor_network.lesion)


def test_a_script_that_goes_on_from_a_saved_model_keeps_no_step_twice(make_model, tmp_path, empty_figures):
    model = make_model()
    model.learn(400, callback=LesionProbe("hold_position", every=200, trials=2, folder=tmp_path / "probes"))
    model.save(tmp_path / "model")
    path = tmp_path / "probes" / PROBE
    before = read_probe(path)
    model.learn(400, callback=LesionProbe("hold_position", every=200, trials=2, folder=tmp_path / "probes"),
                reset_num_timesteps=False)  # fmt: skip
    assert steps(read_probe(path)) == [0, 200, 400, 600, 800]
    again = PPO.load(tmp_path / "model", env=model.get_env())
    again.learn(200, callback=LesionProbe("hold_position", every=200, trials=2, folder=tmp_path / "probes"),
                reset_num_timesteps=False)  # fmt: skip
    after = read_probe(path)
    assert steps(after) == [0, 200, 400, 600]
    pd.testing.assert_frame_equal(after[: len(before)], before)
    again.learn(200, callback=LesionProbe("hold_position", every=200, trials=2, folder=tmp_path / "probes"))
    assert steps(read_probe(path)) == [0, 200]


def test_a_probe_moves_no_random_stream_no_weight_and_no_lesion(make_model):
    model = make_model()
    probe = LesionProbe("hold_position", every=10_000, trials=2)
    model.learn(200, callback=probe)
    network = model.policy.motor_network
    network.set_lesion("shallow_dominant")
    weights = {name: tensor.clone() for name, tensor in model.policy.state_dict().items()}
    streams = torch.get_rng_state(), np.random.get_state(legacy=True)[1], random.getstate()  # noqa: NPY002
    probe.act()
    assert torch.equal(streams[0], torch.get_rng_state())
    np.testing.assert_array_equal(streams[1], np.random.get_state(legacy=True)[1])  # noqa: NPY002
    assert streams[2] == random.getstate()
    assert all(torch.equal(weights[name], tensor) for name, tensor in model.policy.state_dict().items())
    assert network.lesion == LESIONS["shallow_dominant"]


def test_what_cannot_be_probed_is_refused(make_model):
    for policy in ("UnilateralPolicy", "MlpPolicy"):
        with pytest.raises(UserError, match="two hemispheres"):
            make_model(policy).learn(200, callback=LesionProbe("hold_position", every=100))
    for wrong in ({"every": 0}, {"trials": 0}, {"task": "juggle"}):
        with pytest.raises(UserError, match=r"at least 1|juggle"):
            LesionProbe(**{"task": "hold_position", **wrong})


def test_a_figure_that_cannot_be_written_does_not_end_the_training(make_model, tmp_path, empty_figures):
    (tmp_path / f"{FIGURE}.png").mkdir()
    with pytest.warns(UserWarning, match="Cannot write the figure"):
        make_model().learn(200, callback=LesionProbe("hold_position", trials=2, folder=tmp_path))
    assert steps(read_probe(tmp_path / PROBE)) == [0, 200]


# --- the control ----------------------------------------------------------------------------------------------------


def test_the_control_is_the_fresh_network_of_the_seed_that_lesion_studies_compare_with(probed):
    config = probed.config()
    policy = load_policy(probed)
    policy.motor_network.load_state_dict(fresh_network(config, config.seed))
    evaluator = Evaluator(config.task, config.trial, config.evaluation.trials, config.evaluation.seed)
    control = read_probe(probed.path / PROBE).query("network == 'fresh'").set_index("lesion")
    for state, row in control.drop(columns=["network", "timesteps"]).iterrows():
        with policy.motor_network.lesioned(state):
            expected = evaluator.run(policy).summary(config.trial.threshold)
        assert row.to_dict() == pytest.approx(expected, rel=1e-5, nan_ok=True)


def as_of_0_1_0(path):
    table = pd.read_csv(path)
    table[table["network"] == "trained"].drop(columns="network").to_csv(path, index=False)
    return table


def test_a_table_of_version_0_1_0_is_read_and_gets_its_control_when_the_training_goes_on(probed, empty_figures):
    table = as_of_0_1_0(probed.path / PROBE)
    old = read_probe(probed.path / PROBE)
    assert set(old["network"]) == {"trained"}
    assert len(old) == 3 * len(STATES)
    assert specialization_over_training(old.assign(model="cc_s", seed=0), "hold_position") is not None
    resume(probed, config_with(timesteps=6_000))
    resumed = read_probe(probed.path / PROBE)
    assert steps(resumed) == [0, 2_000, 4_000, 6_000]
    pd.testing.assert_frame_equal(resumed[: len(table)], table, check_dtype=False)


def test_where_neither_side_does_better_than_the_control_the_index_is_at_the_floor(make_model, monkeypatch):
    model, logged = make_model(), []
    probe = LesionProbe("hold_position", every=100, trials=4)
    real = probe._rows

    def made_up(records, network, timesteps):
        rows = real(records, network, timesteps)
        side = 30.0 if timesteps >= 400 else 5.0
        values = {"intact": 45.0, "deep_dominant": side, "deep_non_dominant": 5.0}
        return rows.assign(time_in_goal_steps=[values.get(lesion, 1.0) for lesion in rows["lesion"]])

    monkeypatch.setattr(probe, "_rows", made_up)
    model.set_logger(logger := Logger(None, []))
    monkeypatch.setattr(logger, "record", lambda name, value, exclude=None: logged.append((name, value, exclude)))
    model.learn(400, callback=probe)
    index = [(value, exclude) for name, value, exclude in logged if name == "specialization/time_in_goal_5cm"]
    assert [value == "at the floor" for value, _ in index] == [True, True, False]
    assert index[0][1] == ("tensorboard", "csv")
    assert isinstance(index[-1][0], float)


def test_a_table_whose_control_is_damaged_is_refused(probed):
    table = pd.read_csv(probed.path / PROBE)
    for damaged in (
        table.replace({"network": {"fresh": "young"}}),
        table.assign(timesteps=table["timesteps"] + (table["network"] == "fresh")),
        table[1:],
    ):
        damaged.to_csv(probed.path / PROBE, index=False)
        with pytest.raises(UserError, match="is damaged"):
            read_probe(probed.path / PROBE)
