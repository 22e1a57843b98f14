"""Trained networks and policies out of run folders: any seed of any run, whatever trained it."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from gymnasium import spaces
from torch import Tensor, nn

from bilateral_rl.algorithms import ALGORITHM_CLASSES
from bilateral_rl.config.hyperparameters import OffPolicyHyperparameters
from bilateral_rl.config.schema import ActorCriticConfig, CriticsConfig, NetworkConfig, RLConfig, TrainConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.tensors import Tensors
from bilateral_rl.io.text import seed_range
from bilateral_rl.policies import BilateralActorCriticPolicy, MotorPolicy
from bilateral_rl.policies.motor_network import MotorNetwork
from bilateral_rl.policies.networks import make_network
from bilateral_rl.runs.folder import FINAL, RunFolder
from bilateral_rl.vocabulary import stream_mix

_MOST_DIGITS = 10
"""Longest seed accepted, in digits."""

SEEDS = "seeds"
"""Name of the tensor (S,) of the seeds in the weights of a run of several; every other tensor has that leading axis."""


def parse_run(text: str) -> tuple[RunFolder, int | None]:
    """Return the run that RUN or RUN:seed names, and the seed if one is named. Raises UserError for what is no run."""
    path, colon, seed = text.rpartition(":")
    has_seed = colon and seed.isdecimal() and len(seed) <= _MOST_DIGITS
    if has_seed and not os.path.exists(text):  # noqa: PTH110 - which never raises
        return RunFolder.open(Path(path)), int(seed)
    return RunFolder.open(Path(text)), None


def build_network(config: TrainConfig) -> MotorNetwork:
    """Build a fresh network of the run's architecture and sizes, from torch's random state."""
    low, _ = config.trial.observation_bounds(config.n_arms)
    return make_network(n_inputs=len(low), n_outputs=config.n_muscles, **_network_arguments(config))


def _network_arguments(config: TrainConfig) -> dict[str, Any]:
    """Return what says which network the run has, beside the numbers that it sees and commands."""
    settings = {field.name: getattr(config.network, field.name) for field in dataclasses.fields(NetworkConfig)}
    return {"architecture": config.spec.architecture, "n_arms": config.n_arms, **settings}


def build_policy(config: TrainConfig) -> MotorPolicy:
    """Build an untrained policy of the run's architecture and sizes, on the CPU."""
    low, high = config.trial.observation_bounds(config.n_arms)
    return policy_class(config)(
        spaces.Box(low, high),
        spaces.Box(-1.0, 1.0, (config.n_muscles,)),
        lr_schedule=lambda _: 0.0,
        n_streams=len(stream_mix(config.spec.loss)),
        **_critics_inputs(config),
        **policy_arguments(config),
    )


def policy_class(config: TrainConfig) -> type[MotorPolicy]:
    """Return the class of the run's policy; a supervised run's network acts in that of PPO and A2C."""
    algorithm = ALGORITHM_CLASSES.get(config.algo)
    return BilateralActorCriticPolicy if algorithm is None else algorithm.POLICY_CLASS


def policy_arguments(config: TrainConfig) -> dict[str, Any]:
    """Return the keyword arguments of the run's policy, but for those that an algorithm gives it by itself."""
    network = config.network
    of_critics = network if isinstance(network, CriticsConfig) else ActorCriticConfig()
    arguments = dataclasses.asdict(of_critics) | _network_arguments(config)
    if isinstance(config, RLConfig) and isinstance(config.hyperparameters, OffPolicyHyperparameters):
        arguments["n_critics"] = config.hyperparameters.n_critics
    return arguments


def _critics_inputs(config: TrainConfig) -> dict[str, Any]:
    """Return what an algorithm tells its policy of the critics' inputs."""
    if not isinstance(config, RLConfig):
        return {}
    chosen = config.hyperparameters
    inputs: dict[str, Any] = {"n_traces": len(chosen.action_traces)}
    if isinstance(chosen, OffPolicyHyperparameters):
        inputs["standardize_inputs"] = chosen.standardize_inputs
    return inputs


def network_states(folder: RunFolder, weights: str = FINAL) -> dict[int, Tensors]:
    """Return the ``state_dict()`` of a run's networks by seed.

    Raises:
        UserError: the weights are missing or do not fit the run.
    """
    config = folder.config()
    states = _by_seed(folder.load_weights(weights), config, folder)
    if _has_whole_policies(config):
        key = policy_class(config).NETWORK_KEY
        states = {
            seed: {name.removeprefix(key): t for name, t in state.items() if name.startswith(key)}
            for seed, state in states.items()
        }
    network = build_network(config)
    for state in states.values():
        _check_fit(network, state, folder)
    return states


def load_policies(folder: RunFolder, weights: str = FINAL, seed: int | None = None) -> dict[int, MotorPolicy]:
    """Return the policies of a run by seed, ready to act.

    A policy of a supervised run has that run's network and fresh critics.

    Args:
        folder: the run.
        weights: which of its weights.
        seed: the only one to load; None for all.

    Raises:
        UserError: weights that are missing, damaged or of another shape, or a seed that the run has not.
    """
    config = folder.config()
    seeds = config.all_seeds
    if seed is not None and seed not in seeds:
        raise UserError(f"{folder.path} has no seed {seed}; it has {seed_range(seeds)}.")
    states = _by_seed(folder.load_weights(weights), config, folder)
    policies: dict[int, MotorPolicy] = {}
    for one in seeds if seed is None else [seed]:
        policy = build_policy(config)
        if _has_whole_policies(config):
            load_policy_weights(policy, states[one], folder)
        else:
            _check_fit(policy.motor_network, states[one], folder)
            policy.motor_network.load_state_dict(states[one])
        policy.set_training_mode(False)
        policies[one] = policy
    return policies


def load_policy(run: RunFolder | str | Path, weights: str = FINAL, seed: int | None = None) -> MotorPolicy:
    """Return the one policy of a run, or that of one of its seeds.

    Args:
        run: the run, or RUN or RUN:seed as in commands.
        weights: which of its weights.
        seed: which of several.

    Raises:
        UserError: as :func:`load_policies`, or if there are several and none is named.
    """
    if not isinstance(run, RunFolder):
        run, named = parse_run(str(run))
        seed = named if seed is None else seed
    policies = load_policies(run, weights, seed)
    if len(policies) > 1:
        seeds = seed_range(list(policies))
        raise UserError(f"{run.path} has {seeds}: say which one, as {run.path}:{min(policies)}.")
    return next(iter(policies.values()))


def load_policy_weights(policy: MotorPolicy, tensors: dict[str, Tensor], folder: RunFolder) -> None:
    """Copy ``tensors`` into ``policy``. Raises UserError where names or shapes do not fit."""
    _check_fit(policy, tensors, folder)
    policy.load_state_dict(tensors)


def initial_states(config: TrainConfig) -> dict[int, Tensors] | None:
    """Return the networks that ``config.init_from`` names, for each seed of ``config``; None for fresh ones.

    Every seed begins with the network of the seed that is named, or of the run's only one, or of its own number.

    Raises:
        UserError: a run, seed or network that does not fit.
    """
    if config.init_from is None:
        return None
    folder, seed = parse_run(config.init_from)
    source = folder.config()
    wanted, found = _shape(config), _shape(source)
    if wanted != found:
        raise UserError(
            f"The networks of {folder.path} are {_words(found)}, and {config.model} here is {_words(wanted)}: "
            "--init-from needs the same."
        )
    states = network_states(folder)
    if seed is None and len(states) == 1:
        (seed,) = states
    if seed is not None and seed not in states:
        raise UserError(f"{folder.path} has no seed {seed}; it has {seed_range(list(states))}.")
    missing = [s for s in config.all_seeds if s not in states]
    if seed is None and missing:
        raise UserError(
            f"{folder.path} has {seed_range(list(states))}, not {missing[0]}: name one, as {folder.path}:{min(states)}."
        )
    return {s: states[s if seed is None else seed] for s in config.all_seeds}


def _shape(config: TrainConfig) -> dict[str, Any]:
    """Return what says what the parameters of a run's network are."""
    with torch.random.fork_rng(devices=[]):
        arguments = build_network(config).arguments
    return {name: value for name, value in arguments.items() if name != "hidden_noise"}


def _words(shape: Mapping[str, Any]) -> str:
    """Say what a network is, in words."""
    words = f"{shape['architecture']}, {shape['units']} units in {shape['layers']} layers"
    if shape["n_arms"] == 1:
        return words
    words += ", for two arms"
    if shape["ipsilateral_share"] is not None:
        words += f", ipsilateral share {shape['ipsilateral_share']:g}{' at first' * shape['trained_combination']}"
    return words


def stack_states(states: Mapping[int, Tensors]) -> Tensors:
    """Return the weights of a run of several seeds from the ``state_dict()`` of each."""
    names = next(iter(states.values()))
    stacked = {name: torch.stack([state[name] for state in states.values()]) for name in names}
    return {SEEDS: torch.tensor(list(states)), **stacked}


def _by_seed(weights: Tensors, config: TrainConfig, folder: RunFolder) -> dict[int, Tensors]:
    """Return the weights of each seed, stacked or not. Raises UserError unless they are those of the run's seeds."""
    seeds = config.all_seeds
    if SEEDS not in weights and len(seeds) == 1 and _has_whole_policies(config):
        return {config.seed: weights}
    weights = dict(weights)
    stored = weights.pop(SEEDS, torch.empty(0))
    if (
        stored.shape != (len(seeds),)
        or stored.tolist() != seeds
        or any(t.ndim < 1 or len(t) != len(seeds) for t in weights.values())
    ):
        raise UserError(f"The weights of {folder.path} are not those of its seeds, {seed_range(seeds)}.")
    return {seed: {name: tensor[i] for name, tensor in weights.items()} for i, seed in enumerate(seeds)}


def _has_whole_policies(config: TrainConfig) -> bool:
    """Whether a run's weights are those of policies, critics included; supervised runs have networks alone."""
    return config.algo in ALGORITHM_CLASSES


def unfit(module: nn.Module, tensors: Mapping[str, Tensor]) -> list[str]:
    """Return the names of tensors that ``module`` lacks or has otherwise, or of weights that its settings fix."""
    expected = module.state_dict()
    if wrong := sorted({*expected} ^ {*tensors}) or [k for k in expected if not _is_like(tensors[k], expected[k])]:
        return wrong
    fixed = (name for name, parameter in module.named_parameters() if not parameter.requires_grad)
    return [name for name in fixed if not torch.equal(tensors[name], expected[name])]


def _check_fit(module: nn.Module, tensors: Mapping[str, Tensor], folder: RunFolder) -> None:
    if wrong := unfit(module, tensors):
        folder.config().make_task()  # asks for the name of a class, which may be for two arms
        raise UserError(f"The weights of {folder.path} do not fit its configuration, first at {wrong[0]}.")


def _is_like(tensor: Tensor, other: Tensor) -> bool:
    return tensor.shape == other.shape and tensor.dtype == other.dtype
