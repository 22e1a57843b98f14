"""Training where everything is there at once: timelines, forces, losses, noise and delays of a task of one's own."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from rich_tasks import RICH_SETTINGS, Rich, RichPair
from supervised_runs import Watch
from trainers import finish, of_seed

from bilateral_rl.bptt.conditions import Conditions
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.losses import StreamLosses
from bilateral_rl.bptt.noise import draw_noise
from bilateral_rl.bptt.trials import stacked, training_trials
from bilateral_rl.envs import ArmParameters, TrialSettings
from bilateral_rl.envs.losses import LossSettings
from bilateral_rl.envs.measures import trial_measures
from bilateral_rl.envs.tasks import TASKS
from bilateral_rl.envs.trials import TrialBatch
from bilateral_rl.training.run import resume, train

PAPERS = ("callosal", 10, 2)
HIDDEN_NOISE = 0.05


@pytest.fixture
def rich(small_bptt, monkeypatch):
    """Builder of configurations of such trainings."""
    monkeypatch.setitem(TASKS, "rich", Rich)

    def make(**values):
        own = {"trial": {"trial_length": 20} | RICH_SETTINGS, "network": {"hidden_noise": HIDDEN_NOISE}}
        return replace(small_bptt(**own | {"bptt": {"learning_rate": 0.02}} | values), task="rich")

    return make


@pytest.mark.parametrize("task", [Rich(), RichPair()], ids=lambda task: task.id)
def test_a_rollout_is_the_environments_trials_step_for_step(random_networks, make_rollout, task):
    """The same trials, noise and weights in both; the policy is the torch network, which sees the environment."""
    n, n_steps, rng, arms = 64, 20, np.random.default_rng(0), task.n_arms
    spring = {"two_arms": {"spring": {"kind": "distance"}}} if arms > 1 else {}
    settings = TrialSettings(**RICH_SETTINGS | spring, trial_length=n_steps)
    (network,) = random_networks(*PAPERS, n=1, dtype=torch.float32, n_arms=arms)
    conditions = Conditions.of(task, settings, HIDDEN_NOISE)
    rollout = make_rollout([network], n, n_steps, conditions=conditions)
    rollout.load(stacked([training_trials(7, n, task, settings)]))
    draw_noise(rollout, [7], "training")
    normal = rng.standard_normal((n * arms, n_steps + 1, 20))
    rollout.noise[0] = torch.from_numpy(normal[:, :n_steps] * settings.noise_scale).float()
    rollout.forward()

    batch = TrialBatch(task, settings, n)
    uniform = np.random.default_rng(np.random.SeedSequence(7, spawn_key=(1,))).random((n, task.n_uniform))
    batch.start(np.arange(n, dtype=np.int32), task.trials(uniform, settings), normal)
    weights = torch.tensor(settings.losses.weights)
    for t in range(n_steps):
        np.testing.assert_allclose(rollout.observation[0, :, t], batch.observation, atol=1e-4)
        with torch.no_grad():
            seen = torch.from_numpy(batch.observation.copy())
            excitation = network.excitation(seen, rollout.hidden_noise[0, :, t])
        batch.step((2 * excitation - 1).numpy())
        np.testing.assert_allclose(rollout.excitation[0, :, t], batch.excitation, atol=2e-5)
        np.testing.assert_allclose(rollout.hand[0, :, t], batch.hand, atol=1e-4)
        terms = rollout.terms[0, :, t].unflatten(0, (n, arms)).mean(1)
        rewards = -(terms @ weights.T).numpy()
        np.testing.assert_allclose(rewards, batch.vector_reward, rtol=1e-3, atol=1e-4)
    targets = rollout.targets()
    np.testing.assert_allclose(targets.distance[0], batch.distance, atol=1e-4)
    np.testing.assert_array_equal(targets.onset[0], batch.onset)
    np.testing.assert_allclose(targets.start_distance[0], batch.start_distance, atol=1e-4)
    assert {0, n_steps} < set(batch.onset.tolist()), "some have a cue at once, later or never"


def test_seeds_of_a_stack_end_with_the_bits_that_they_have_alone_by_any_number_of_threads(
    make_trainer, rich, same_bits
):
    stacks = [finish(make_trainer(rich(seeds=3, seed=5, threads=threads))) for threads in (1, 2)]
    for index in range(3):
        alone = finish(make_trainer(rich(seeds=1, seed=5 + index, threads=1)))
        assert all(same_bits(of_seed(stack, index), of_seed(alone, 0)) for stack in stacks)
    assert len(torch.unique(stacks[0].weights, dim=0)) == 3


@pytest.mark.usefixtures("no_pictures")
def test_a_training_with_noise_that_was_stopped_ends_with_the_same_bits(tmp_path, rich, assert_same_end):
    config = rich(bptt={"learning_rate": 0.02, "trials": 64})
    whole = train(config, tmp_path).folder
    folder = train(config, tmp_path, Watch(6)).folder
    resume(folder, config)
    assert_same_end(folder, whole)


def test_the_history_measures_from_the_onset(make_trainer, rich):
    """Against the measures of the validation trials done once more."""
    trainer = make_trainer(rich(seeds=2))
    trainer.run_epoch()
    rollout = trainer._rollout(trainer._losses("combined").rollout_size(2, 8, 20))
    rollout.weights.copy_(trainer.state.weights)
    rollout.load(trainer._validation)
    draw_noise(rollout, trainer.config.all_seeds, "validation")
    rollout.forward()
    targets = rollout.targets()
    for seed in range(2):
        history = dict(zip(trainer.columns, trainer.state.history[seed, -1].tolist(), strict=True))
        parts = (targets.distance[seed].numpy(), targets.start_distance[seed].numpy())
        means = trial_measures(*parts, trainer.config.trial.threshold, targets.onset[seed].numpy()).means()
        assert history["goal_completion_percent"] == means["goal_completion_percent"]
        assert history["final_error_cm"] == pytest.approx(means["final_error_cm"], rel=1e-6)


def test_losses_are_the_weighted_means_of_all_six_terms(make_trainer, rich):
    trainer = make_trainer(rich(seeds=1))
    losses = trainer._losses("specialized")
    rollout = trainer._rollout(losses.rollout_size(1, 8, 20))
    rollout.load(trainer._validation)
    rollout.weights.copy_(trainer.state.weights[:1])
    rollout.forward()
    means = rollout.terms[0].double().mean((0, 1))
    assert (means > 0).all()
    weights = torch.tensor([[0.0, 5.0, 2.0, 0.0, 0.3, 0.2], [5.0, 0.0, 0.0, 0.4, 0.0, 0.0]], dtype=torch.float64)
    penalty = trainer.config.penalty_coefficient * 0.5 * rollout.weights[0].double().square().sum()
    expected = weights @ means + torch.tensor([0.0, 2.0], dtype=torch.float64) * penalty
    torch.testing.assert_close(losses.values(rollout)[:, 0], expected, rtol=1e-6, atol=0)


@pytest.mark.parametrize("weight", [0.0, 3.0])
def test_the_weight_of_the_penalty_is_a_setting(random_networks, weight):
    layout, settings = Layout(random_networks(*PAPERS, n=1)[0]), LossSettings(dominant={"penalty": weight})
    losses = StreamLosses("specialized", "weights", 0.1, layout, ArmParameters(), settings)
    assert losses.penalty_weights == (weight, 2.0)
    assert losses.weight_decay == [weight * 0.1, 0.2]
    assert losses.term_weights.tolist() == [[0.0, 5.0, 2.0], [5.0, 0.0, 0.0]]
