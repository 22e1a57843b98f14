"""Sensory noise, motor noise and feedback delay: what they change, by how much, and what they leave alone."""

import numpy as np
import pytest

from bilateral_rl.envs import ArmEnv, ArmVecEnv

SENSED, TARGET = slice(0, 14), slice(14, 16)
STEPS = 50


def commands(n, seed=0):
    """Excitations from 0.4 to 0.6: far enough from their bounds for noise to be added whole."""
    return np.random.default_rng(seed).uniform(-0.2, 0.2, (STEPS, n, 6)).astype(np.float32)


def record(n, seed=0, **settings):
    """Observations (51, n, 16), rewards (50, n) and activations (51, n, 6) of the first trial of ``n`` arms."""
    venv = ArmVecEnv(n, seed=seed, trial_length=STEPS + 1, **settings)
    observations, rewards, activations = [venv.reset()], [], [venv.batch.muscle[:, 0].copy()]
    for command in commands(n):
        observation, reward, _, _ = venv.step(command)
        observations.append(observation)
        rewards.append(reward)
        activations.append(venv.batch.muscle[:, 0].copy())
    return np.array(observations), np.array(rewards), np.array(activations)


def single(seed=0, trials=1, **settings):
    """Observations of the trials of one arm, one after the other."""
    env, observations = ArmEnv(trial_length=STEPS, **settings), []
    for trial in range(trials):
        observations.append(env.reset(seed=seed if trial == 0 else None)[0])
        observations += [env.step(command[0])[0] for command in commands(1)]
    return np.array(observations)


def excitation_behind(activation):
    """The excitation of each step that explains activation's course (Thelen 2003, solved for u)."""
    before, change = activation[:-1].astype(np.float64), np.diff(activation.astype(np.float64), axis=0)
    scale = 0.5 + 1.5 * before
    tau = np.where(change > 0, 0.015 * scale, 0.05 / scale)
    return before + change * tau / 0.01


def assert_white(noise, std):
    """(steps, n, k): mean 0, the standard deviation asked for, no correlation between columns, steps or arms."""
    np.testing.assert_allclose(noise.std(axis=(0, 1)), std, rtol=0.03)
    assert np.abs(noise.mean(axis=(0, 1))).max() < 0.05 * std
    columns = np.corrcoef(noise.reshape(-1, noise.shape[2]).T)
    assert np.abs(columns - np.eye(noise.shape[2])).max() < 0.06
    for one, other in ((noise[1:], noise[:-1]), (noise[:, 1:], noise[:, :-1])):
        assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.02
    assert np.abs(noise).max() > 3 * std


def test_sensory_noise_is_white_with_the_standard_deviation_asked_for_on_every_sensed_number():
    clean, noisy = record(200)[0], record(200, sensory_noise=0.01)[0]
    inside = (np.abs(clean[..., 12:14]) < 0.58).all(axis=(0, 2))  # arms whose hand the observation bound never clips
    assert inside.sum() > 50
    assert_white((noisy - clean)[:, inside, SENSED], 0.01)


def test_sensory_noise_touches_neither_the_target_nor_the_reward():
    (clean, reward, activation), (noisy, noisy_reward, noisy_activation) = record(8), record(8, sensory_noise=0.05)
    np.testing.assert_array_equal(noisy[..., TARGET], clean[..., TARGET])
    np.testing.assert_array_equal(noisy_reward, reward)
    np.testing.assert_array_equal(noisy_activation, activation)


def test_noisy_observations_stay_in_their_space():
    observations = record(20, sensory_noise=2.0)[0]
    space = ArmEnv().observation_space
    assert (observations >= space.low).all()
    assert (observations <= space.high).all()
    assert (observations[..., SENSED] == space.low[SENSED]).any()


def test_motor_noise_is_white_with_the_standard_deviation_asked_for_on_every_muscle():
    activation = record(200, motor_noise=0.02)[2]
    commanded = (commands(200) + 1) / 2
    settled = slice(15, None)  # the rounding of the first large changes is not noise
    assert_white((excitation_behind(activation) - commanded)[settled], 0.02)


def test_motor_noise_is_not_paid_for():
    """The reward's effort is that of the command: from the same hand and target it is the noiseless one."""
    env = ArmEnv(motor_noise=0.1)
    env.reset(seed=0)
    action = np.full(6, 0.2, dtype=np.float32)
    observation, _, _, _, info = env.step(action)
    error = observation[12:14].astype(np.float64) - observation[14:]
    np.testing.assert_allclose(info["vector_reward"][0], -50 * np.square(error).mean() - 2 * 0.6**2, rtol=1e-5)


def test_there_is_no_noise_by_default():
    _, _, activation = record(4)
    np.testing.assert_allclose(excitation_behind(activation)[15:], (commands(4)[15:] + 1) / 2, atol=2e-5)
    for zero in ({"sensory_noise": 0.0}, {"motor_noise": 0.0}):
        for default, given in zip(record(4), record(4, **zero), strict=True):
            np.testing.assert_array_equal(default, given)
    np.testing.assert_array_equal(single(seed=0), single(seed=0))


@pytest.mark.parametrize("noise", ["sensory_noise", "motor_noise"])
def test_noise_follows_the_seed_and_changes_from_trial_to_trial(noise):
    settings = {noise: 0.05}
    np.testing.assert_array_equal(single(seed=3, trials=3, **settings), single(seed=3, trials=3, **settings))
    given = {"start": (1.0, 1.0)}
    env, trials = ArmEnv(**settings), []
    for _ in range(3):
        observation, _ = env.reset(options=given)
        trials.append([observation, *(env.step(command[0])[0] for command in commands(1))])
    assert not np.array_equal(trials[0], trials[1])
    assert not np.array_equal(trials[1], trials[2])


def test_sensory_noise_does_not_change_motor_noise():
    """Each has numbers of its own, so an experiment can turn on one and keep the other."""
    motor_only, both = record(4, motor_noise=0.02), record(4, motor_noise=0.02, sensory_noise=0.05)
    np.testing.assert_array_equal(motor_only[2], both[2])


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_what_is_sensed_lags_by_the_delay_and_the_target_does_not(noise):
    now = record(3, sensory_noise=noise)[0]
    for delay in (1, 5, STEPS, STEPS + 10):
        delayed = record(3, sensory_noise=noise, feedback_delay=delay)[0]
        seen = np.maximum(np.arange(STEPS + 1) - delay, 0)  # before anything is fed back, the start is
        np.testing.assert_array_equal(delayed[..., SENSED], now[seen][..., SENSED])
        np.testing.assert_array_equal(delayed[..., TARGET], now[..., TARGET])


def test_delay_changes_neither_the_arm_nor_the_reward():
    (_, reward, activation), (_, delayed_reward, delayed_activation) = record(3), record(3, feedback_delay=4)
    np.testing.assert_array_equal(reward, delayed_reward)
    np.testing.assert_array_equal(activation, delayed_activation)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_new_trial_senses_nothing_of_the_last_one(noise):
    observations = single(trials=2, feedback_delay=7, sensory_noise=noise).reshape(2, STEPS + 1, 16)
    start = observations[1, 0]
    np.testing.assert_array_equal(observations[1, :8], [start] * 8)
    assert not np.array_equal(observations[1, 12], start)


LENGTHS, VELOCITIES, SEEN = slice(0, 6), slice(6, 12), slice(12, 14)


@pytest.mark.parametrize(
    ("setting", "own"), [("length_noise", LENGTHS), ("velocity_noise", VELOCITIES), ("vision_noise", SEEN)]
)
def test_noise_of_one_sense_is_on_that_sense_alone_and_as_large_as_asked_for(setting, own):
    clean, noisy = record(100)[0], record(100, **{setting: 0.01})[0]
    np.testing.assert_array_equal(np.delete(noisy, own, axis=2), np.delete(clean, own, axis=2))
    inside = (np.abs(clean[..., 12:14]) < 0.58).all(axis=(0, 2))
    assert_white((noisy - clean)[:, inside, own], 0.01)


def test_noise_of_its_own_takes_the_place_of_the_common_one():
    common, own = record(4, sensory_noise=0.02)[0], record(4, sensory_noise=0.02, vision_noise=0.0)[0]
    np.testing.assert_array_equal(own[..., :12], common[..., :12])
    np.testing.assert_array_equal(own[..., SEEN], record(4)[0][..., SEEN])
    alike = {"length_noise": 0.02, "velocity_noise": 0.02, "vision_noise": 0.02}
    np.testing.assert_array_equal(record(4, **alike)[0], common)


@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("delays", [(0, 5), (5, 0), (2, 3), (STEPS + 3, 1)])
def test_muscles_and_hand_lag_each_by_its_own_delay(delays, noise):
    now = record(3, sensory_noise=noise)[0]
    muscles, hand = delays
    delayed = record(3, sensory_noise=noise, proprioception_delay=muscles, vision_delay=hand)[0]
    for lag, sense in ((muscles, slice(0, 12)), (hand, SEEN), (0, TARGET)):
        seen = np.maximum(np.arange(STEPS + 1) - lag, 0)
        np.testing.assert_array_equal(delayed[..., sense], now[seen][..., sense])


def test_a_delay_of_its_own_takes_the_place_of_the_common_one():
    np.testing.assert_array_equal(
        record(3, feedback_delay=4, vision_delay=1)[0], record(3, proprioception_delay=4, vision_delay=1)[0]
    )


@pytest.mark.parametrize(
    "settings",
    [
        {"feedback_delay": 3, "proprioception_delay": 1, "vision_delay": 0},
        {"sensory_noise": 0.1, "length_noise": 0.0, "velocity_noise": 0.1, "vision_noise": 0.2},
    ],
)
def test_a_common_setting_that_no_sense_is_left_for_is_refused(settings):
    common, *own = settings
    with pytest.raises(ValueError, match=f"^{common} has no effect where {', '.join(own)} are all given: leave one"):
        ArmEnv(**settings)
    ArmEnv(**{name: settings[name] for name in own})
