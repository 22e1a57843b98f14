"""Who acts."""

import numpy as np

from bilateral_rl.analysis.conditions import conditions
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.envs.anatomy import elbow_and_hand
from bilateral_rl.policies.lesions import LESIONS, RELEASED_LESIONS
from bilateral_rl.runs.policies import load_policy
from bilateral_rl.training.run import train
from bilateral_rl.video.cast import Actor, labels


def test_labels_say_who_acts_and_name_the_folder_only_where_needed(bptt_run, run):
    seeds = [Actor.load(f"{bptt_run.path}:{seed}", "final") for seed in (0, 2)]
    as_trained = conditions(seeds[0].config)
    assert labels(seeds, "intact", as_trained) == ["cc_s · bptt · seed 0", "cc_s · bptt · seed 2"]
    ppo = Actor.load(str(run.path), "final")
    as_trained = conditions(ppo.config)
    assert labels([ppo], "deep_non_dominant", as_trained) == ["cc_s · ppo · seed 0 · lesion: deep non-dominant"]
    assert labels([ppo, ppo], "intact", as_trained) == ["cc_s · ppo · seed 0 (cc_s-ppo-1)"] * 2


def test_a_second_line_of_labels_says_what_is_unusual_in_the_trials(run):
    ppo = Actor.load(str(run.path), "final")
    noisy = conditions(ppo.config, None, {"trial": {"sensory_noise": 0.1}})
    assert labels([ppo], "intact", noisy) == ["cc_s · ppo · seed 0\nsensory_noise=0.1"]
    curl = conditions(ppo.config, "curl_field", {"experiment": {"forces": {"curl": 9}}, "trial": {"trial_length": 50}})
    assert labels([ppo], "intact", curl) == ["cc_s · ppo · seed 0\ncurl_field, forces.curl=9.0"]
    arm = {name: [0.1] * 6 for name in ("tendon_length", "optimal_muscle_length")}
    (label,) = labels([ppo], "intact", conditions(ppo.config, None, {"trial": {"arm": arm}}))
    assert len(label.splitlines()[1]) <= 64
    assert label.endswith(" …")


def test_the_chosen_weights_act(bptt_run, same_bits):
    run = f"{bptt_run.path}:1"
    states = {weights: Actor.load(run, weights).policy.motor_network.state_dict() for weights in ("final", "best")}
    assert not same_bits(states["final"], states["best"])
    for weights, state in states.items():
        assert same_bits(state, load_policy(run, weights).motor_network.state_dict())


def test_a_film_shows_the_posture_that_was_whichever_way_the_elbow_bent(small_bptt, tmp_path):
    arm = {"joint_lower_limit": [0.0, -2.0], "joint_upper_limit": [2.0, 2.0]}
    config = small_bptt(seeds=1, epochs=1, trial={"arm": arm})
    actor = Actor.load(str(train(config, tmp_path).folder.path), "final")
    performance = actor.perform(Evaluator("random_reach", config.trial, 16, seed=0), "intact", 0.05, "")
    record = performance.record
    for trial in range(16):
        (scene,) = performance.scene(trial, 5, "").arms
        np.testing.assert_array_equal(scene.angles, record.joint[trial, 5])
        np.testing.assert_allclose(elbow_and_hand(record.arm, scene.angles)[1], record.hand[trial, 5], atol=1e-6)
    assert (record.joint[:, 5, 1] < -0.5).any()
    assert (record.joint[:, 5, 1] > 0.5).any()


def test_a_run_of_the_released_profile_has_the_released_lesions(small_bptt, tmp_path):
    actors = [
        Actor.load(str(train(small_bptt(profile=profile, epochs=1), tmp_path).folder.path), "final")
        for profile in ("paper", "released")
    ]
    name = "callosum_deep_dominant"
    for actor, lesion in zip(actors, (LESIONS[name], RELEASED_LESIONS[name]), strict=True):
        evaluator = Evaluator("random_reach", actor.config.trial, 2, seed=0)
        with actor.policy.motor_network.lesioned(lesion):
            expected = evaluator.run(actor.policy).hand
        np.testing.assert_array_equal(actor.perform(evaluator, name, 0.05, "").record.hand, expected)
        assert (actor.perform(evaluator, "intact", 0.05, "").record.hand != expected).any()
