"""Bounds that concern several fields of a configuration; those of one stand at the field.

What would take far more memory than any use of it is refused, so that a slip of the finger is a sentence and not a
full memory.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import operator
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from bilateral_rl.config.code_tasks import is_code
from bilateral_rl.config.hyperparameters import (
    MOST_NUMBERS,
    NUMBERS_PER_STEP,
    BPTTHyperparameters,
    OffPolicyHyperparameters,
    OnPolicyHyperparameters,
)
from bilateral_rl.config.parse import flat
from bilateral_rl.config.schema import MAX_SEED, BPTTConfig, RLConfig, TrainConfig
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.task_specs import TASK_SPECS
from bilateral_rl.envs.two_arms import OF_ROLES, TwoArmSettings
from bilateral_rl.io.errors import UserError
from bilateral_rl.vocabulary import GROUPS, SIDES, stream_mix, stream_names

MOST_PARAMETERS = 10**7
"""Parameters of a network or a critic."""
SMALLEST, LARGEST = 1e-9, 1e6
"""Sizes of any number but 0 that describes a trial or an arm, whatever its unit."""

_OBSERVED = {1: 16, 2: 40}
"""Numbers in an observation, by the number of arms."""
_NOISE = 20
"""Normal numbers of a step of an arm, for senses and muscles."""
_PER_TRIAL = 32
"""Numbers that set a trial of an arm, roughly."""


def check(config: TrainConfig) -> None:
    """Raise a UserError for settings that cannot work together, or that would fill the memory."""
    if config.all_seeds[-1] > MAX_SEED:
        raise UserError(f"The last seed, seed + seeds - 1, must be at most {MAX_SEED:,}, got {config.all_seeds[-1]:,}.")
    _check_network(config)
    _check_combination(config)
    _check_frozen(config)
    if config.blocks.every and not (config.experiment and config.experiment.has_field):
        raise UserError(f"blocks.every tests an adaptation to a field, which {config.task} has not: leave it out.")
    _check_losses(config)
    if isinstance(config, RLConfig):
        _check_rl(config)
    if isinstance(config, BPTTConfig):
        _check_bptt(config)
    check_trial(config)
    check_fit(config)
    if config.n_arms == 2:
        _check_chosen_roles(config)
        _check_tests(config)
    for name, size in _parameters(config):
        if size > MOST_PARAMETERS:
            raise UserError(f"The number of parameters of {name} must be at most {MOST_PARAMETERS:,}, got {size:,}.")
    for name, size in _arrays(config):
        if size > MOST_NUMBERS:
            raise UserError(f"{name} would make an array of {size:,} numbers, and {MOST_NUMBERS:,} are the most.")


def _check_losses(config: TrainConfig) -> None:
    """Raise a UserError for a model with a loss that weighs nothing of what the arm does."""
    weighed = [any(terms) for terms in config.trial.losses.weights]
    for mix, name in zip(stream_mix(config.spec.loss), stream_names(config.spec.loss), strict=True):
        if not any(share and some for share, some in zip(mix, weighed, strict=True)):
            raise UserError(
                f"{config.model} learns by the {name.replace('_', '-')} loss, and trial.losses weighs none of its "
                "terms: give one of them a weight above 0."
            )


def check_trial(config: TrainConfig) -> None:
    """Raise a UserError for numbers of a trial or an arm that are far out of use."""
    for name, value in _numbers("trial", dataclasses.asdict(config.trial)):
        if value and not SMALLEST <= abs(value) <= LARGEST:
            raise UserError(f"{name} must lie between {SMALLEST:g} and {LARGEST:g} in size, got {value:g}.")


def check_fit(config: TrainConfig) -> None:
    """Raise a UserError for a task that cannot run on these arms, or in trials of this length."""
    if config.n_arms == 1 and config.trial.two_arms != TwoArmSettings() and not is_code(config.task):
        refuse_without_effect(["two_arms"], config)
    if config.experiment is None:
        if config.task in TASK_SPECS and config.n_arms == 2:  # those of one arm run with any settings
            _check_task(config)
        return
    from bilateral_rl.envs.experiments.checks import UnfitExperimentError, check_experiment  # numerical

    try:
        check_experiment(config.experiment, config.trial)
    except UnfitExperimentError as error:
        where = "" if error.field.startswith("trial.") else "experiment."
        raise UserError(f"{where}{error}") from None


def check_roles(settings: Mapping[str, Any], config: TrainConfig) -> None:
    """Raise a UserError for ``settings`` that say who reaches, and how far, in a task that does not draw by them."""
    given = [name for name, _ in flat(settings)]
    if config.n_arms == 2:
        refuse_without_effect([name for name in OF_ROLES if f"trial.{name}" in given], config)


def _check_chosen_roles(config: TrainConfig) -> None:
    """Raise the UserError of :func:`check_roles` for what is not as usual, be it of the configuration of a run."""
    usual = TrialSettings()
    chosen = [name for name in OF_ROLES if (of := operator.attrgetter(name))(config.trial) != of(usual)]
    refuse_without_effect(chosen, config)


def refuse_without_effect(names: Sequence[str], config: TrainConfig) -> None:
    """Raise a UserError, in the words of environments, if the first of these settings of trials has no effect."""
    if not names:
        return
    from bilateral_rl.envs.doors import without_effect  # numerical

    if sentence := without_effect(config.make_task()).get(names[0]):
        raise UserError(f"trial.{sentence}")


def _check_tests(config: TrainConfig) -> None:
    """Refuse an odd number of trials in tests where each is also done with the arms exchanged."""
    trials = {"blocks.trials": config.blocks.trials if config.blocks.every else 0}
    if isinstance(config, RLConfig):
        trials["evaluation.trials"] = config.evaluation.trials
    for name, number in trials.items():
        if number % 2 and config.make_task().is_symmetric(config.trial):
            raise UserError(
                f"{name} must be even in {config.task}, where each trial is also done with the arms exchanged, got "
                f"{number}."
            )


def _check_task(config: TrainConfig) -> None:
    try:
        config.make_task().check(config.trial)
    except ValueError as error:
        raise UserError(f"{config.task} cannot run so: {error}") from None


def check_updates(config: TrainConfig) -> None:
    """Raise a UserError for a new training that ends before its network would be updated once.

    Runs that were made so can be read, so that :func:`check` does not ask.
    """
    if not isinstance(config, RLConfig) or not isinstance(config.hyperparameters, OffPolicyHyperparameters):
        return
    algo, chosen = config.algo, config.hyperparameters
    at_a_time = config.n_envs * chosen.train_freq
    rounds = math.ceil(config.timesteps / at_a_time) - chosen.learning_starts // at_a_time
    updates = max(rounds, 0) * chosen.gradient_steps
    if not updates:
        raise UserError(
            f"There would be no update: {algo}.learning_starts is {chosen.learning_starts:,} of {config.timesteps:,} "
            "timesteps. Give fewer of the former or more of the latter."
        )
    delay = chosen.policy_delay
    if updates // delay <= chosen.critic_warm_up // delay:
        besides = f" with {algo}.policy_delay {delay}" if delay > 1 else ""
        raise UserError(
            f"The network would never be updated: {algo}.critic_warm_up is {chosen.critic_warm_up:,} of {updates:,} "
            f"updates{besides}. Give fewer of the former, or more timesteps."
        )


def _check_network(config: TrainConfig) -> None:
    """Refuse sizes that the architecture cannot have, without building it: that would draw random weights."""
    architecture, units, layers = config.spec.architecture, config.network.units, config.network.layers
    trouble = None
    if architecture != "unilateral" and units % 2:
        trouble = f"a {architecture} network splits its units over two sides, and network.units = {units} is odd"
    elif architecture == "callosal" and units < 4:
        trouble = f"a callosal network pools two units a side, so network.units must be at least 4, got {units}"
    elif architecture == "callosal" and layers < 2:
        trouble = f"a callosum lies between hidden layers, so network.layers must be at least 2, got {layers}"
    if trouble is not None:
        raise UserError(f"The model {config.model} cannot be built: {trouble}.")


def _check_combination(config: TrainConfig) -> None:
    """Refuse weights of the hemispheres in the commands to two arms where there are no two, or nothing to weigh."""
    share, trained = config.network.ipsilateral_share, config.network.trained_combination
    given = {"ipsilateral_share": share, "trained_combination": trained}
    name = next((name for name, value in given.items() if value is not None), None)
    if name is None:
        return
    if config.n_arms == 1:
        config.make_task()  # asks for the name of a class, which may be for two arms
        raise UserError(f"network.{name} is for tasks of two arms, and {config.task} has one: leave it out.")
    if config.spec.architecture == "unilateral":
        raise UserError(f"network.{name} has no effect on {config.model}, which has no hemispheres: leave it out.")
    if trained and share == 0:
        raise UserError(
            "network.trained_combination has nothing to weigh where network.ipsilateral_share is 0, and each arm "
            "follows one hemisphere alone: leave it out, or give a share above 0."
        )


def _check_frozen(config: TrainConfig) -> None:
    """Refuse to freeze sides that there are not, or everything."""
    if config.frozen and config.spec.architecture == "unilateral":
        raise UserError(f"frozen names sides, which the model {config.model} has not: leave it out.")
    groups = GROUPS if config.network.ipsilateral_share != 0 else SIDES
    if missing := [group for group in config.frozen if group not in groups]:
        raise UserError(
            f"frozen names {missing[0]}, and nothing is where network.ipsilateral_share is 0: name one of the sides."
        )
    if len(config.frozen) == len(groups):
        most = "two" if len(groups) > 2 else "one"
        raise UserError(f"frozen leaves nothing to learn: give {most} of {', '.join(groups)} at most.")


def _check_rl(config: RLConfig) -> None:
    chosen = config.hyperparameters
    if isinstance(chosen, OnPolicyHyperparameters) and chosen.n_steps * config.n_envs < 2:
        raise UserError(
            f"{config.algo}.n_steps times n_envs must be at least 2: one sample has no advantage to normalize."
        )


def _check_bptt(config: BPTTConfig) -> None:
    settings, trial = config.bptt, config.trial
    if settings.trials % settings.batch_size:
        raise UserError(
            f"bptt.trials must be a multiple of bptt.batch_size, got {settings.trials} and {settings.batch_size}."
        )
    if config.penalty != "weights" and trial.trial_length < 2:
        raise UserError(
            f"The penalty {config.penalty} looks at rates of change, so trial.trial_length must be at least 2, got 1."
        )


def _numbers(name: str, value: Any) -> Iterator[tuple[str, float]]:
    """Yield every number in nested settings, with where it stands; words are none."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _numbers(f"{name}.{key}", item)
    elif isinstance(value, tuple):
        for item in value:
            yield from _numbers(name, item)
    elif not isinstance(value, str):
        yield name, value


def _parameters(config: TrainConfig) -> Iterator[tuple[str, int]]:
    """Yield what has parameters, and roughly how many."""
    yield "the network", _size(config, _hidden(config))
    if isinstance(config, RLConfig):
        yield "a critic", _size(config, config.network.critic_arch)


def _arrays(config: TrainConfig) -> Iterator[tuple[str, int]]:
    """Yield the settings that make each of the large arrays, and roughly how many numbers it holds."""
    steps = config.trial.trial_length + max(config.trial.delays)
    supervised, seeds = BPTTHyperparameters(), 1  # any network may be retrained so after a lesion
    if isinstance(config, BPTTConfig):
        supervised, seeds = config.bptt, config.seeds
    hidden = sum(_hidden(config))
    of_arms = NUMBERS_PER_STEP * config.n_arms
    per_step = hidden + of_arms + (_NOISE * config.n_arms if config.trial.noisy else 0)
    per_step += hidden if config.network.hidden_noise else 0
    yield "seeds and network", seeds * _size(config, _hidden(config))
    yield "bptt.batch_size, seeds, trial and network", seeds * supervised.batch_size * steps * per_step
    yield "bptt.validation_trials, seeds, trial and network", seeds * supervised.validation_trials * steps * per_step
    yield "bptt.trials and seeds", seeds * supervised.trials * _PER_TRIAL * config.n_arms
    yield "blocks.trials and trial", config.blocks.trials * steps * of_arms
    if isinstance(config, RLConfig):
        chosen = config.hyperparameters
        per_step = of_arms + len(chosen.action_traces) * (config.n_muscles + 1)
        yield "n_envs and trial", config.n_envs * steps * of_arms
        yield "evaluation.trials and trial", config.evaluation.trials * steps * of_arms
        if isinstance(chosen, OnPolicyHyperparameters):
            yield f"n_envs and {config.algo}.n_steps", config.n_envs * chosen.n_steps * per_step
        if isinstance(chosen, OffPolicyHyperparameters):
            kept = config.timesteps if chosen.buffer_size is None else chosen.buffer_size
            whole = "" if chosen.buffer_size else " null, which keeps all timesteps,"
            yield f"{config.algo}.buffer_size{whole}", kept * per_step


def _hidden(config: TrainConfig) -> list[int]:
    return [config.network.units] * config.network.layers


def _size(config: TrainConfig, widths: Sequence[int]) -> int:
    """Count the parameters of a network with these hidden layers, roughly."""
    sizes = [_OBSERVED[config.n_arms], *widths, config.n_muscles]
    return sum(n * m + m for n, m in itertools.pairwise(sizes))
