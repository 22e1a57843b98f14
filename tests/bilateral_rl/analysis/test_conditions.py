"""What tests take of a run's settings, and what they refuse since it would change nothing."""

import pytest

from bilateral_rl.analysis.conditions import conditions
from bilateral_rl.config.resolve import resolve
from bilateral_rl.envs import ArmVecEnv
from bilateral_rl.envs.doors import arguments_for
from bilateral_rl.envs.experiments.experiment import Experiment
from bilateral_rl.envs.tasks import make_task
from bilateral_rl.io.errors import UserError

REACH, HOLD, FIELD, PAIR = (
    resolve(None, task, []) for task in ("random_reach", "hold_position", "curl_field", "two_reaches")
)


def test_the_conditions_are_those_of_the_training_unless_others_are_chosen():
    under = conditions(REACH)
    assert (under.task, under.settings, under.changed, under.notes) == ("random_reach", REACH.trial, {}, ())
    under = conditions(REACH, "hold_position", {"trial": {"max_load": 4, "feedback_delay": 2}})
    assert (under.settings.max_load, under.settings.feedback_delay, under.settings.trial_length) == (4.0, 2, 50)
    assert under.changed == {"task": "hold_position", "trial.max_load": 4.0, "trial.feedback_delay": 2}
    assert under.notes == ()
    assert conditions(REACH, "random_reach", {"trial": {"trial_length": 50}}).changed == {}


def test_what_a_task_brings_stays_with_it_and_what_was_chosen_goes_along():
    tied, two = resolve(None, "reach_and_hold", []), "two_reaches"
    own = {"trial": {"two_arms": {"spring": {"stiffness": 20}}}}
    assert conditions(tied).settings.two_arms.spring.stiffness == 50
    under = conditions(tied, two)
    assert under.settings.two_arms.spring.stiffness == 0
    assert under.changed == {"task": two}
    assert conditions(resolve(None, two, []), "reach_and_hold").settings == tied.trial
    assert conditions(resolve(None, "reach_and_hold", [own]), two).settings.two_arms.spring.stiffness == 20
    places = {"start": {"joints": "uniform"}, "target": {"joints": "uniform"}}
    delayed = resolve(None, Experiment(name="seen_late", **places, trial={"vision_delay": 5}), [])
    assert conditions(delayed).settings.vision_delay == 5
    assert conditions(delayed, "random_reach").settings.vision_delay is None


def test_in_another_task_what_it_does_not_have_by_itself_is_told():
    tied, two, spring = resolve(None, "reach_and_hold", []), "two_reaches", "trial.two_arms.spring.stiffness"
    as_trained = {"trial": {"two_arms": {"spring": {"stiffness": 50}}}}
    assert conditions(tied, two, as_trained).changed == {"task": two, spring: 50.0}
    assert conditions(tied, None, as_trained).changed == {}
    noisy = resolve(None, "random_reach", [{"trial": {"sensory_noise": 0.01}}])
    assert conditions(noisy).changed == {}
    assert conditions(noisy, "hold_position").changed == {"task": "hold_position", "trial.sensory_noise": 0.01}
    under = conditions(REACH, "curl_field", {"experiment": {"forces": {"curl": 9}}})
    assert under.changed == {"task": "curl_field", "experiment.forces.curl": 9}
    assert conditions(resolve(None, "curl_field", []), "random_reach").changed == {"task": "random_reach"}


@pytest.mark.parametrize("chosen", [{}, {"trial": {"trial_length": 60}}], ids=["as it was", "changed by hand"])
def test_an_experiment_that_was_edited_since_brings_its_own_settings_of_trials(chosen):
    places = {"start": {"joints": "uniform"}, "target": {"joints": "uniform"}}
    before, after = (
        Experiment(name="mine", **places, trial={"threshold": radius, "vision_delay": delay})
        for radius, delay in ((0.03, 4), (0.06, 2))
    )
    run = resolve(None, before, [chosen])
    under = conditions(run, after)
    assert (under.settings.threshold, under.settings.vision_delay) == (0.06, 2)
    assert under.settings.trial_length == run.trial.trial_length
    assert under.changed == {"trial.threshold": 0.06, "trial.vision_delay": 2}
    assert conditions(run, before) == conditions(run)


def test_a_force_where_there_was_none_is_one_change():
    places = {"start": {"joints": "uniform"}, "target": {"joints": "uniform"}}
    run = resolve(None, Experiment(name="mine", **places), [])
    assert conditions(run, None, {"experiment": {"forces": {"curl": 8}}}).changed == {"experiment.forces.curl": 8.0}
    arms = {side: {"start": {"joints": "uniform"}, "target": "start"} for side in ("dominant", "non_dominant")}
    curl = {"experiment": {"arms": {"dominant": {"forces": {"curl": 8}}}}}
    under = conditions(resolve(None, Experiment(name="two", arms=arms), []), None, curl)
    assert under.changed == {"experiment.arms.dominant.forces.curl": 8.0}


def test_supervised_networks_are_tested_with_noise_and_delay_too():
    under = conditions(resolve("bptt", None, []), None, {"trial": {"motor_noise": 0.1, "feedback_delay": 3}})
    assert under.settings.noisy


@pytest.mark.parametrize(
    ("config", "task", "settings", "says"),
    [
        (REACH, None, {"ppo": {"gamma": 0.9}}, "ppo.gamma changes nothing in a test.*such as trial.sensory_noise"),
        (REACH, None, {"seed": 3}, "seed changes nothing in a test"),
        (REACH, None, {"network": {"units": 12}}, "network.units changes nothing in a test"),
        (REACH, None, {"threshold": 0.03}, r"threshold changes nothing in a test.*did you mean trial.threshold\?"),
        (REACH, None, {"two_arms": {"roles": "drawn"}}, r"did you mean trial.two_arms.roles\?"),
        (REACH, None, {"trial": {"losses": {"dominant": {"penalty": 1}}}}, "no reward has the penalty"),
        (FIELD, None, {"experiment": {"name": "mine"}}, "experiment.name changes nothing in a test"),
        (FIELD, None, {"experiment": {"description": "mine"}}, "experiment.description changes nothing in a test"),
        (
            PAIR,
            None,
            {"trial": {"two_arms": {"spring": {"kind": "distance"}}}},
            "kind changes nothing without a spring",
        ),
        (REACH, None, {"trial": {"gamma": 0.9}}, "Unknown setting 'gamma' in trial"),
        (REACH, None, {"trial": 3}, "trial must be settings by name"),
        (REACH, None, {"trial": {"sensory_noise": -1}}, "trial.sensory_noise must be at least 0"),
        (REACH, None, {"trial": {"arm": {"timestep": 1e-30}}}, "trial.arm.timestep must lie between"),
        (REACH, None, {"trial": {"max_load": 3}}, "trial.max_load changes nothing in random_reach"),
        (HOLD, "random_reach", {"trial": {"load": "direction"}}, "trial.load changes nothing in random_reach"),
        (REACH, "juggle", {}, "Unknown task 'juggle'; choose from random_reach, hold_position"),
    ],
)
def test_what_changes_nothing_or_cannot_be_is_refused(config, task, settings, says):
    with pytest.raises(UserError, match=says):
        conditions(config, task, settings)


def test_a_run_that_chose_roles_can_be_tested_where_there_is_nothing_to_choose():
    run = resolve("bptt", "reach_and_hold", [{"trial": {"two_arms": {"roles": "dominant_reaches"}}}])
    task = make_task("two_holds")
    arms = ArmVecEnv(1, task, **arguments_for(task, conditions(run, "two_holds").settings))
    assert (arms.two_arms.roles, arms.two_arms.spring.stiffness) == ("drawn", 0)


def test_notes_say_what_is_easily_missed():
    (note,) = conditions(REACH, None, {"trial": {"arm": {"timestep": 0.005}}}).notes
    assert "5 ms here and was 10 ms" in note
    assert "50 steps lasts 0.25 s" in note
    (note,) = conditions(REACH, None, {"trial": {"arm": {"normalized_max_velocity": 8.0}}}).notes
    assert "maximal velocities of this arm" in note
    (note,) = conditions(REACH, None, {"trial": {"arm": {"link_length": [0.3, 0.3]}}}).notes
    assert "0.6 m" in note
    assert "0.642 m" in note
