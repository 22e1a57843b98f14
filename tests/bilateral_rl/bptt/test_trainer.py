"""Training of stacked networks: every seed as if it were alone, and as plain torch does it."""

import math

import numpy as np
import pytest
import torch
from one_arm_tasks import ONE_ARM_TASKS
from trainers import finish, of_seed

from bilateral_rl.bptt import targets as targets_module
from bilateral_rl.bptt.trials import epoch_order, initial_weights_seed, training_trials, validation_trials
from bilateral_rl.config.catalogue import MODELS, find_model
from bilateral_rl.envs import Arm
from bilateral_rl.envs.tasks import make_task
from bilateral_rl.runs.policies import build_network

# Stacks


@pytest.mark.parametrize("task", ONE_ARM_TASKS)
@pytest.mark.parametrize("model", ["cc_s", "uni_b"])
def test_a_seed_of_a_stack_ends_with_the_bits_it_has_alone(make_trainer, small_bptt, same_bits, model, task):
    settings = {"model": model, "task": task, "bptt": {"learning_rate": 0.02}}
    stacks = [finish(make_trainer(small_bptt(seeds=3, seed=5, threads=threads, **settings))) for threads in (1, 2)]
    for index in range(3):
        alone = finish(make_trainer(small_bptt(seeds=1, seed=5 + index, threads=1, **settings)))
        assert all(same_bits(of_seed(stack, index), of_seed(alone, 0)) for stack in stacks)
    assert len(torch.unique(stacks[0].weights, dim=0)) == 3


@pytest.mark.parametrize("penalty", ["activity", "released"])
def test_the_other_penalties_and_odd_sizes_do_not_join_seeds_either(make_trainer, small_bptt, same_bits, penalty):
    sizes = {"trials": 9, "batch_size": 3, "validation_trials": 5}
    settings = {"model": "bi_s", "trial": {"trial_length": 7}, "bptt": {"penalty": penalty, **sizes}}
    stack = finish(make_trainer(small_bptt(seeds=5, threads=2, **settings)))
    for index in (0, 2, 4):
        alone = finish(make_trainer(small_bptt(seeds=1, seed=index, threads=1, **settings)))
        assert same_bits(of_seed(stack, index), of_seed(alone, 0))


def test_seeds_that_stop_at_different_times_end_as_they_do_alone(make_trainer, small_bptt, same_bits):
    settings = {"epochs": 12, "bptt": {"learning_rate": 0.2, "patience": 2}}
    stack = finish(make_trainer(small_bptt(seeds=4, **settings)))
    assert len(set(stack.epochs.tolist())) > 2
    for index in range(4):
        alone = finish(make_trainer(small_bptt(seeds=1, seed=index, **settings)))
        assert same_bits(of_seed(stack, index), of_seed(alone, 0))


def test_each_seed_has_its_own_trials_and_validation_trials(make_trainer, small_bptt):
    config = small_bptt(task="hold_position", seed=3)
    trainer = make_trainer(config)
    for stacked, draw, n in (
        (trainer._training, training_trials, 32),
        (trainer._validation, validation_trials, 8),
    ):
        for index in range(2):
            own = draw(3 + index, n, make_task("hold_position"), config.trial)
            assert all(torch.equal(part[index], of_own) for part, of_own in zip(stacked, own, strict=True))


# The same in plain torch


class InTorch:
    """One seed's training by autograd through ``Arm.step``, written down from the paper (sections 4 and 5)."""

    TERMS = {"dominant": (0.0, 5.0, 2.0, 0.0), "non_dominant": (5.0, 0.0, 0.0, 2.0), "combined": (2.5, 2.5, 1.0, 1.0)}
    """Weights of Cartesian 1, Cartesian 2, activation and weight penalty."""

    def __init__(self, config, seed):
        self.config, self.seed, self.model = config, seed, find_model(config.model)
        torch.manual_seed(initial_weights_seed(seed))
        self.network = build_network(config)
        self.arm = Arm(config.trial.arm)
        self.moments = [(torch.zeros_like(p), torch.zeros_like(p)) for p in self.network.parameters()]
        self.updates = 0

    def run(self, trials):
        """The four terms of the losses, the distances (n, T) to the target, and what was seen (n, T, 16)."""
        state, steps, distances, seen = self.arm.rest(trials.start), [], [], []
        for _ in range(self.config.trial.trial_length):
            observation = torch.cat([self.arm.proprioception(state), state.cartesian[:, :2], trials.target], dim=1)
            u = self.network.excitation(observation)
            state = self.arm.step(state, u, trials.load)
            e = state.cartesian[:, :2] - trials.target
            steps.append(torch.stack([e.abs().mean(), (10 * e).square().mean() / 10, u.square().mean()]))
            distances.append(e.norm(dim=1))
            seen.append(observation)
        squares = sum(p.square().sum() for p in self.network.parameters())
        terms = [*torch.stack(steps).mean(0), self.config.penalty_coefficient * 0.5 * squares]
        return terms, torch.stack(distances, dim=1).detach(), torch.stack(seen, dim=1).detach()

    def loss(self, name, terms):
        return sum(weight * term for weight, term in zip(self.TERMS[name], terms, strict=True))

    def epoch(self, epoch):
        """Mean loss of each stream, mean gradient norm of each group."""
        config = self.config
        n, size = config.bptt.trials, config.bptt.batch_size
        trials = training_trials(self.seed, n, make_task(config.task), config.trial)
        order = torch.from_numpy(epoch_order(self.seed, epoch, n))
        streams = ["dominant", "non_dominant"] if self.model.loss == "specialized" else [self.model.loss]
        rows = []
        for batch in order.split(size):
            terms, *_ = self.run(type(trials)(*(part[batch] for part in trials)))
            losses = [self.loss(stream, terms) for stream in streams]
            rows.append([*(float(loss.detach()) for loss in losses), *self.update(losses)])
        return np.mean(rows, axis=0)

    def update(self, losses):
        parameters = list(self.network.parameters())
        of_loss = [torch.autograd.grad(loss, parameters, retain_graph=True, allow_unused=True) for loss in losses]
        share = {"dominant": (1.0, 0.0), "non_dominant": (0.0, 1.0), "shared": (0.5, 0.5)}
        squares = {}
        self.updates += 1
        rate = self.config.bptt.learning_rate * math.sqrt(1 - 0.999**self.updates) / (1 - 0.9**self.updates)
        for index, (name, parameter) in enumerate(self.network.named_parameters()):
            group = self.network.group_of(name)
            shares = share[group] if len(losses) > 1 else (1.0,)
            gradient = sum(s * of[index] for s, of in zip(shares, of_loss, strict=True) if s)
            squares[group] = squares.get(group, 0.0) + float(gradient.square().sum())
            gradient = gradient / max(1.0, float(gradient.norm()) / self.config.bptt.clip_norm)
            first, second = self.moments[index]
            first.mul_(0.9).add_(0.1 * gradient)
            second.mul_(0.999).add_(0.001 * gradient.square())
            parameter.data -= rate * first / (second.sqrt() + self.config.bptt.epsilon)
            if name.startswith("combination"):
                parameter.data.clamp_(min=0.0)
        groups = [group for group in ("dominant", "non_dominant", "shared") if group in squares]
        return [math.sqrt(squares[group]) for group in groups]

    @torch.no_grad()
    def validate(self):
        """Loss, goal completion (%), steps in the goal, final error (cm), and what each side supplied."""
        config = self.config
        n = config.bptt.validation_trials
        terms, distances, seen = self.run(validation_trials(self.seed, n, make_task(config.task), config.trial))
        name = "combined" if self.model.loss == "specialized" else self.model.loss
        inside = (distances <= config.trial.threshold).tolist()
        completed = [any(all(row[i : i + 3]) for i in range(len(row) - 2)) for row in inside]
        time_in_goal = np.mean([sum(row) for row in inside])
        return [
            float(self.loss(name, terms)),
            100 * np.mean(completed),
            time_in_goal,
            100 * float(distances[:, -1].mean()),
            *(self.supplied(seen) if self.model.architecture != "unilateral" else ()),
        ]

    def supplied(self, seen):
        """Modulation, share (%) and constant part of what each side adds before the sigmoid."""
        network = self.network
        weights = (network.combination_dominant, network.combination_non_dominant)
        added = [w * h @ network.output.weight.T for w, h in zip(weights, network.hemispheres(seen), strict=True)]
        moves = [float(part.std(dim=(0, 1), unbiased=False).mean()) for part in added]
        constant = [float(part.mean(dim=(0, 1)).abs().mean()) for part in added]
        return [*moves, *(100 * one / sum(moves) for one in moves), *constant]


@pytest.mark.parametrize(
    ("model", "task", "threshold"),
    [("cc_s", "random_reach", 0.3), ("bi_ns", "hold_position", 0.05), ("uni_dl", "random_reach", 0.3)],
)
def test_epochs_bring_what_plain_torch_brings(make_trainer, small_bptt, model, task, threshold):
    config = small_bptt(model=model, task=task, trial={"threshold": threshold}, bptt={"learning_rate": 0.01})
    trainer = make_trainer(config)
    state, reference = finish(trainer), InTorch(config, 1)
    for epoch in range(3):
        expected = [*reference.epoch(epoch), *reference.validate()]
        np.testing.assert_allclose(state.history[1, epoch], expected, rtol=2e-4, err_msg=f"{trainer.columns}")
    assert 0 < state.history[1, -1, trainer.columns.index("time_in_goal_steps")] < 20
    assert state.history[1, -1, trainer.columns.index("goal_completion_percent")] > 0
    weights = trainer.layout.unpack(state.weights)
    for name, parameter in reference.network.named_parameters():
        # Of six updates by about 0.01 each.
        np.testing.assert_allclose(weights[name][1], parameter.detach(), atol=3e-5, err_msg=name)


def test_the_history_names_streams_groups_measures_and_sides(make_trainer, small_bptt):
    ends = ["validation_loss", "goal_completion_percent", "time_in_goal_steps", "final_error_cm"]
    assert make_trainer(small_bptt()).columns == [
        *("loss_dominant", "loss_non_dominant"),
        *("gradient_norm_dominant", "gradient_norm_non_dominant", "gradient_norm_shared"),
        *ends,
        *("contribution_dominant", "contribution_non_dominant"),
        *("contribution_percent_dominant", "contribution_percent_non_dominant"),
        *("contribution_constant_dominant", "contribution_constant_non_dominant"),
    ]
    assert make_trainer(small_bptt(model="uni_dl")).columns == ["loss_dominant", "gradient_norm_shared", *ends]
    assert make_trainer(small_bptt(model="bi_ns")).columns[0] == "loss_combined"


def test_validation_measures_trials_from_where_they_start(make_trainer, small_bptt, monkeypatch):
    config, measured = small_bptt(epochs=1), []
    measure = targets_module.trial_measures

    def watch(distance, start_distance, threshold):
        measured.append((distance, start_distance))
        return measure(distance, start_distance, threshold)

    monkeypatch.setattr(targets_module, "trial_measures", watch)
    finish(make_trainer(config))
    for seed, (distance, start_distance) in enumerate(measured):
        trials = validation_trials(seed, 8, make_task(config.task), config.trial)
        hand = Arm(config.trial.arm).rest(trials.start).cartesian[:, :2]
        np.testing.assert_allclose(start_distance, (hand - trials.target).norm(dim=1), rtol=1e-5)
        assert distance.shape == (8, 20)
    assert len(measured) == 2


def test_the_learning_rate_goes_to_its_end_over_all_epochs_from_update_to_update(make_trainer, small_bptt):
    trainer, rates = make_trainer(small_bptt(epochs=2, bptt={"learning_rate": 0.02, "final_learning_rate": 0.01})), []
    while not trainer.finished:
        trainer.run_epoch(lambda _: rates.append(trainer._running.optimizer.learning_rate) is None)
    n = trainer.config.total
    assert rates == pytest.approx([0.02 - 0.01 * update / n for update in range(n)])


def test_the_number_of_torchs_threads_is_left_as_it_was(make_trainer, small_bptt):
    threads, during = torch.get_num_threads(), []
    torch.set_num_threads(2)
    try:
        trainer = make_trainer(small_bptt())
        assert torch.get_num_threads() == 2
        trainer.run_epoch(lambda _: during.append(torch.get_num_threads()) or True)
        trainer.run_epoch(lambda _: False)
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(threads)
    assert set(during) == {1}


@pytest.mark.parametrize("model", MODELS)
def test_every_model_learns_both_tasks_by_either_profile(make_trainer, small_bptt, model):
    settings = {"learning_rate": 0.03, "patience": 10}
    for task, profile in (("random_reach", "paper"), ("hold_position", "released")):
        trainer = make_trainer(small_bptt(model=model, task=task, profile=profile, epochs=10, bptt=settings))
        history = finish(trainer).history
        losses = history[:, :, [name.startswith("loss_") for name in trainer.columns]].sum(2)
        validation = history[:, :, trainer.columns.index("validation_loss")]
        assert (losses[:, -1] < 0.95 * losses[:, 0]).all(), task
        assert (validation[:, -1] < 0.95 * validation[:, 0]).all(), task
