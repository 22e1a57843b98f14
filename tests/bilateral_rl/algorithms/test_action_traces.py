"""Traces of past actions: their arithmetic, what the critics see of them, and what the network does not."""

import numpy as np
import pytest
import torch
from hemispheric_models import (
    ALGORITHMS,
    OFF_POLICY,
    ON_POLICY,
    RandomEnds,
    Recorder,
    arm,
    collect,
    gradients_of_update,
    make_model,
    names_by_group,
    weights,
)
from stable_baselines3.common.vec_env import DummyVecEnv

from bilateral_rl.algorithms.action_traces import ActionTraces

DECAYS = (0.5, 0.8)
each_algorithm = pytest.mark.parametrize("algorithm", ALGORITHMS)


def looped_traces(decays, actions, dones):
    """(before, after) each step of each environment, number by number: (T, n, n_decays · (n_actions + 1))."""
    n_steps, n_envs, n_actions = actions.shape
    before = np.zeros((n_steps, n_envs, len(decays), n_actions + 1))
    after = np.zeros_like(before)
    for i in range(n_envs):
        x = np.zeros((len(decays), n_actions + 1))
        for t in range(n_steps):
            before[t, i] = x
            for k, decay in enumerate(decays):
                for j, a in enumerate([*actions[t, i], 1.0]):
                    x[k, j] = decay * x[k, j] + (1 - decay) * a
            after[t, i] = x
            if dones[t, i]:
                x[:] = 0.0
    return before.reshape(n_steps, n_envs, -1), after.reshape(n_steps, n_envs, -1)


def test_a_trace_is_a_running_average_of_the_actions_and_of_one():
    traces, actions = ActionTraces((0.0, 0.75), 2), np.array([[0.5, -1.0]], dtype=np.float32)
    assert traces.size == 6
    once = traces.advance(traces.start(1), actions)
    np.testing.assert_allclose(once, [[0.5, -1.0, 1.0, 0.125, -0.25, 0.25]])
    twice = traces.advance(once, 0 * actions)
    np.testing.assert_allclose(twice, [[0.0, 0.0, 1.0, 0.09375, -0.1875, 0.4375]])


@pytest.mark.parametrize("decay", [1.0, -0.1, float("nan"), float("inf")])
@each_algorithm
def test_a_decay_outside_of_0_to_1_is_refused(algorithm, decay):
    with pytest.raises(ValueError, match="at least 0 and less than 1, got"):
        make_model(algorithm, action_traces=(0.5, decay))


@pytest.mark.parametrize("decays", [0.5, None, "0.5", ("a",), [[0.5]]])
@each_algorithm
def test_what_is_no_sequence_of_decays_is_refused_in_a_sentence(algorithm, decays):
    with pytest.raises(ValueError, match=r"action_traces must be .*(not|got) "):
        make_model(algorithm, action_traces=decays)


def random_ends():
    return Recorder(DummyVecEnv([RandomEnds] * 3))


@each_algorithm
@pytest.mark.parametrize("make_env", [lambda: Recorder(arm()), random_ends], ids=["arm", "random ends"])
def test_the_buffer_holds_the_traces_before_every_step(algorithm, make_env):
    env = make_env()
    model = collect(make_model(algorithm, env=env, action_traces=DECAYS))
    low, high = env.action_space.low, env.action_space.high
    actions = np.stack([2 * (a - low) / (high - low) - 1 for a in env.actions])
    dones = np.stack([step[2] for step in env.steps])
    assert dones.any()
    assert not dones.all()
    before, after = looped_traces(DECAYS, actions, dones)
    buffer = model.rollout_buffer if algorithm in ON_POLICY else model.replay_buffer
    np.testing.assert_allclose(buffer.traces[: len(before)], before, atol=1e-5)
    np.testing.assert_allclose(model._last_traces, np.where(dones[-1][:, None], 0, after[-1]), atol=1e-5)
    if algorithm in OFF_POLICY:
        steps, envs = np.divmod(np.arange(before.shape[0] * before.shape[1]), before.shape[1])
        samples = buffer.kept(10**6)
        np.testing.assert_allclose(samples.traces, before[steps, envs], atol=1e-5)
        # Also after the last step of a trial that time has cut: the value of its last observation goes on.
        np.testing.assert_allclose(samples.next_traces, after[steps, envs], atol=1e-5)


@each_algorithm
def test_a_new_start_of_the_environment_starts_the_traces_anew(algorithm):
    model = collect(make_model(algorithm, action_traces=DECAYS))
    assert model._last_traces.any()
    model._setup_learn(10, reset_num_timesteps=False)
    assert model._last_traces.any()
    model._setup_learn(10)
    assert not model._last_traces.any()
    collect(model).set_env(arm())  # which makes SB3 reset
    model._setup_learn(10, reset_num_timesteps=False)
    assert not model._last_traces.any()


@each_algorithm
def test_the_critics_see_the_traces_and_the_network_does_not(algorithm):
    model, without = make_model(algorithm, action_traces=DECAYS), make_model(algorithm)
    shapes = {name: value.shape for name, value in weights(without).items()}
    wider = {name for name, value in weights(model).items() if value.shape != shapes[name]}
    assert wider
    assert all("qf" in name or "critics" in name for name in wider)
    observations, traces = torch.randn(5, 16), torch.randn(5, 14)
    actions = (torch.tanh(torch.randn(5, 6)),) if algorithm in OFF_POLICY else ()

    def values(traces):
        if algorithm in OFF_POLICY:
            return model.policy.stream_values(model.policy.critic, observations, *actions, traces)
        return model.policy.predict_stream_values(observations, traces)

    assert (values(traces) != values(traces + 1)).all()
    with pytest.raises(ValueError, match="14 numbers of action traces besides observations, got 0"):
        values(None)
    with pytest.raises(ValueError, match="got 7"):
        values(traces[:, :7])
    model.predict(observations.numpy())


@pytest.mark.parametrize("algorithm", ON_POLICY)
def test_sb3s_values_are_refused_with_traces(algorithm):
    policy = make_model(algorithm, action_traces=DECAYS).policy
    with pytest.raises(ValueError, match=r"give them to predict_stream_values\(obs, traces\)"):
        policy.predict_values(torch.zeros(1, 16))
    with pytest.raises(ValueError, match=r"give them to predict_stream_values\(obs, traces\)"):
        policy(torch.zeros(1, 16))
    assert make_model(algorithm).policy.predict_values(torch.zeros(1, 16)).shape == (1, 1)


@each_algorithm
def test_every_group_still_learns_from_its_stream_alone(algorithm):
    """Critics of the other stream that value everything otherwise change nothing for it."""
    routed = []
    for factor in (1.0, 3.0):
        model = make_model(algorithm, action_traces=DECAYS, weight_penalty=0.0, policy_kwargs={"units": 8})
        with torch.no_grad():
            for parameter in model.parameter_groups()["critic_1"]:
                parameter *= factor
        routed.append(gradients_of_update(collect(model)))
    for group, names in names_by_group(model).items():
        same = [torch.equal(routed[0][name], routed[1][name]) for name in names if routed[0][name] is not None]
        assert same, group
        assert all(same) if group in ("dominant", "critic_0") else not all(same), group


@each_algorithm
def test_a_model_with_traces_comes_back_and_goes_on(algorithm, tmp_path):
    model = make_model(algorithm, action_traces=DECAYS).learn(80)
    model.save(tmp_path / "model")
    loaded = algorithm.load(tmp_path / "model", env=arm(2), device="cpu")
    assert loaded.action_traces == DECAYS
    loaded.learn(40)
    with pytest.raises(ValueError, match="a saved model keeps its traces"):
        algorithm.load(tmp_path / "model", action_traces=(), device="cpu")


@each_algorithm
def test_what_the_buffer_takes_from_the_algorithm_cannot_be_given_otherwise(algorithm):
    buffer = "rollout_buffer_kwargs" if algorithm in ON_POLICY else "replay_buffer_kwargs"
    for other in ({"n_streams": 5}, {"action_traces": (0.1,)}):
        with pytest.raises(ValueError, match=r"follows from the algorithm, .* leave it out"):
            make_model(algorithm, action_traces=DECAYS, **{buffer: other})


@pytest.mark.parametrize("algorithm", OFF_POLICY)
def test_a_replay_buffer_of_other_traces_is_not_loaded(algorithm, tmp_path):
    collect(make_model(algorithm, action_traces=DECAYS)).save_replay_buffer(tmp_path / "buffer")
    make_model(algorithm, action_traces=DECAYS).load_replay_buffer(tmp_path / "buffer.pkl")
    other = make_model(algorithm, action_traces=(0.5, 0.9))
    present = other.replay_buffer
    with pytest.raises(ValueError, match=r"traces of decays \(0.5, 0.8\), and action_traces is \(0.5, 0.9\)"):
        other.load_replay_buffer(tmp_path / "buffer.pkl")
    assert other.replay_buffer is present


@each_algorithm
def test_a_saved_model_keeps_its_decays(algorithm, tmp_path):
    make_model(algorithm, action_traces=DECAYS).save(tmp_path / "model")
    assert algorithm.load(tmp_path / "model", env=arm()).action_traces == DECAYS
    with pytest.raises(ValueError, match=r"follows from the algorithm, .* leave it out"):
        algorithm.load(tmp_path / "model", env=arm(), action_traces=(0.1, 0.2))
