"""The whole state of an SB3 algorithm as named tensors: everything that the rest of its training depends on.

The state is taken between two iterations of ``learn`` (``_on_rollout_start`` of a callback). Restored into a newly
built algorithm, the training goes on to the same bits. Rollout buffers are empty at that point and are not saved.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from operator import attrgetter
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from torch import Tensor, nn

from bilateral_rl.envs.generators import generator_states, set_generator_states
from bilateral_rl.io.tensors import DTYPES, Tensors
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.policies.hidden_noise import HiddenNoise
from bilateral_rl.training.random_states import random_states, set_random_states

UPDATE_RULES = 2
"""Counts the changes to what updates do by the same settings: a training goes on to the same bits only by its own.

1, which states do not name: versions 0.1.0 and 0.2.0. 2: the weight penalty is scaled as the loss that it is a term of.
"""
RULES = "counter.update_rules"
"""The name of that count in a state."""
_COUNTERS = ("num_timesteps", "_n_updates", "_episode_num")
_MOMENTS: dict[type[torch.optim.Optimizer], set[str]] = {
    torch.optim.Adam: {"exp_avg", "exp_avg_sq"},
    torch.optim.RMSprop: {"square_avg"},
}
"""The moments of each parameter that the optimizers of our algorithms remember, besides their ``step``."""


def state_tensors(algorithm: BaseAlgorithm) -> Tensors:
    """Return the state by name, ``<part>.<name>``. Some tensors are live views: save or copy them before going on.

    The algorithm's environment must have ``state_arrays``, as :class:`~bilateral_rl.envs.ArmVecEnv` has.
    """
    return join({part: read(algorithm) for part, (read, _) in _PARTS.items()})


def goes_by_other_rules(tensors: Mapping[str, Tensor]) -> bool:
    """Whether the state is that of a version whose updates do something else by the same settings."""
    rules = tensors.get(RULES, torch.tensor(1))
    return rules.numel() == 1 and int(rules) != UPDATE_RULES


def restore(algorithm: BaseAlgorithm, tensors: Mapping[str, Tensor]) -> None:
    """Put a newly built ``algorithm`` where :func:`state_tensors` was called; go on without ``reset_num_timesteps``.

    Raises:
        ValueError: the tensors are not the state of such a training; the algorithm must not be used any more.
    """
    check(tensors)
    parts = split(tensors)
    if unknown := sorted({*parts} - {*_PARTS}):
        raise ValueError(f"it holds an unknown {unknown[0]!r}")
    algorithm._setup_learn(1)  # makes what only learning makes: buffers of episodes, the first observation
    for part, (_, write) in _PARTS.items():
        write(algorithm, parts.get(part, {}))


def check(tensors: Mapping[str, Tensor]) -> None:
    """Raise a ValueError that names the first tensor of a type that no state has, or with a non-finite number."""
    for name, tensor in tensors.items():
        if tensor.dtype not in DTYPES:
            raise ValueError(f"its {name} is of type {tensor.dtype}")
        if tensor.is_floating_point() and not name.startswith("log.") and not tensor.isfinite().all():
            raise ValueError(f"its {name} is not finite")


def join(parts: Mapping[str, Tensors]) -> Tensors:
    """Return the tensors of all parts in one dictionary, named ``<part>.<name>``."""
    return {f"{part}.{name}": tensor for part, tensors in parts.items() for name, tensor in tensors.items()}


def split(tensors: Mapping[str, Tensor]) -> dict[str, Tensors]:
    """Return the tensors of each part: the inverse of :func:`join`."""
    parts: dict[str, Tensors] = {}
    for full_name, tensor in tensors.items():
        part, _, name = full_name.partition(".")
        parts.setdefault(part, {})[name] = tensor
    return parts


def fill(part: str, present: Mapping[str, Tensor], stored: Mapping[str, Tensor]) -> None:
    """Copy ``stored`` into the present tensors of the same names.

    Raises:
        ValueError: names, shapes or types differ.
    """
    for name in sorted({*present} | {*stored}):
        if name not in present or name not in stored:
            raise ValueError(f"it {'lacks' if name in present else 'holds an unknown'} {part}.{name}")
        expected = present[name]
        if expected.shape != stored[name].shape or expected.dtype != stored[name].dtype:
            raise ValueError(f"its {part}.{name} is not a {expected.dtype} tensor of shape {tuple(expected.shape)}")
    with torch.no_grad():
        for name, tensor in present.items():
            tensor.copy_(stored[name])


# --- counters -------------------------------------------------------------------------------------------------------


def _counters(algorithm: BaseAlgorithm) -> Tensors:
    rules = {RULES.removeprefix("counter."): torch.tensor(UPDATE_RULES)}
    return rules | {name: torch.tensor(getattr(algorithm, name)) for name in _COUNTERS}


def _set_counters(algorithm: BaseAlgorithm, stored: Tensors) -> None:
    counters = _counters(algorithm)
    fill("counter", counters, stored)
    if min(counters.values()) < 0:
        raise ValueError("its counters are negative")
    for name in _COUNTERS:
        setattr(algorithm, name, int(counters[name]))


# --- weights and optimizers -----------------------------------------------------------------------------------------


def _weights(algorithm: BaseAlgorithm) -> Tensors:
    """Return the parameters of what SB3 itself counts as the model: modules, and variables outside of them."""
    names, variables = algorithm._get_torch_save_params()
    weights = {name: attrgetter(name)(algorithm) for name in variables}
    for name in names:
        if isinstance(module := attrgetter(name)(algorithm), nn.Module):
            weights |= {f"{name}.{key}": tensor for key, tensor in module.state_dict().items()}
    return {name: tensor.detach() for name, tensor in weights.items()}


def _set_weights(algorithm: BaseAlgorithm, stored: Tensors) -> None:
    fill("weights", _weights(algorithm), stored)


def _optimizers(algorithm: BaseAlgorithm) -> dict[str, torch.optim.Optimizer]:
    names, _ = algorithm._get_torch_save_params()
    saved = {name: attrgetter(name)(algorithm) for name in names}
    return {name: one for name, one in saved.items() if isinstance(one, torch.optim.Optimizer)}


def _moments(algorithm: BaseAlgorithm) -> Tensors:
    """Return what each optimizer remembers, as ``<optimizer>.<index of the parameter>.<name>``."""
    return {
        f"{name}.{index}.{key}": torch.as_tensor(value)
        for name, optimizer in _optimizers(algorithm).items()
        for index, moments in optimizer.state_dict()["state"].items()
        for key, value in moments.items()
    }


def _set_moments(algorithm: BaseAlgorithm, stored: Tensors) -> None:
    optimizers = _optimizers(algorithm)
    if unknown := sorted(key for key in stored if key.rsplit(".", 2)[0] not in optimizers):
        raise ValueError(f"it holds an unknown optimizer.{unknown[0]}")
    for name, optimizer in optimizers.items():
        moments = {key.removeprefix(f"{name}."): t for key, t in stored.items() if key.rsplit(".", 2)[0] == name}
        groups = optimizer.state_dict()["param_groups"]
        optimizer.load_state_dict({"state": _optimizer_state(optimizer, moments), "param_groups": groups})


def _optimizer_state(optimizer: torch.optim.Optimizer, stored: Tensors) -> dict[int, dict[str, Any]]:
    """Return the state by parameter, as ``load_state_dict`` takes it; a parameter that never moved has none.

    Raises ValueError for what is no state of such an optimizer.
    """
    parameters = [parameter for group in optimizer.param_groups for parameter in group["params"]]
    names = _MOMENTS[type(optimizer)]
    state: dict[int, dict[str, Any]] = {}
    for key, tensor in stored.items():
        index, _, name = key.partition(".")
        if not index.isdecimal() or int(index) >= len(parameters) or name not in {"step", *names}:
            raise ValueError(f"it holds an unknown optimizer.{key}")
        if name == "step":
            if tensor.ndim or tensor.dtype != torch.float32 or not float(tensor) >= 0:
                raise ValueError(f"its optimizer.{key} is not a number of steps")
            state.setdefault(int(index), {})[name] = tensor
            continue
        parameter = parameters[int(index)]
        if tensor.shape != parameter.shape or tensor.dtype != parameter.dtype:
            raise ValueError(f"its optimizer.{key} is not a {parameter.dtype} tensor of shape {tuple(parameter.shape)}")
        state.setdefault(int(index), {})[name] = tensor
    for number, moments in state.items():
        if missing := sorted({"step", *names} - moments.keys()):
            raise ValueError(f"it lacks optimizer.{number}.{missing[0]}")
    return state


# --- environment and replay -----------------------------------------------------------------------------------------


def _environment(algorithm: BaseAlgorithm) -> Tensors:
    arrays = algorithm.env.state_arrays()  # type: ignore[union-attr]
    return {name: torch.from_numpy(array) for name, array in arrays.items()}


def _set_environment(algorithm: BaseAlgorithm, stored: Tensors) -> None:
    arrays = {name: tensor.numpy() for name, tensor in stored.items()}
    try:
        algorithm.env.set_state_arrays(arrays)  # type: ignore[union-attr]
    except ValueError as error:
        raise ValueError(f"in its environment, {error}") from None


def _last(algorithm: BaseAlgorithm) -> Tensors:
    arrays = {"observation": algorithm._last_obs, "episode_starts": algorithm._last_episode_starts}
    traces = getattr(algorithm, "_last_traces", None)
    if traces is not None and traces.size:  # states of earlier versions have none
        arrays["traces"] = traces
    return {name: torch.from_numpy(array) for name, array in arrays.items()}


def _set_last(algorithm: BaseAlgorithm, stored: Tensors) -> None:
    fill("last", _last(algorithm), stored)


def _replay(algorithm: BaseAlgorithm) -> Tensors:
    """Return the filled rows of the replay buffer, where the next step goes, and whether it has gone round."""
    buffer = getattr(algorithm, "replay_buffer", None)
    if buffer is None:
        return {}
    filled = buffer.buffer_size if buffer.full else buffer.pos
    arrays = {name: torch.from_numpy(array[:filled]) for name, array in _arrays(buffer).items()}
    return {"pos": torch.tensor(buffer.pos), "full": torch.tensor(buffer.full), **arrays}


def _set_replay(algorithm: BaseAlgorithm, stored: Tensors) -> None:
    buffer = getattr(algorithm, "replay_buffer", None)
    if buffer is not None:
        position = {"pos": torch.tensor(0), "full": torch.tensor(False)}
        fill("replay", position, {name: stored[name] for name in position if name in stored})
        buffer.pos, buffer.full = int(position["pos"]), bool(position["full"])
        if not 0 <= buffer.pos < buffer.buffer_size:
            raise ValueError("its replay.pos is out of range")
    fill("replay", _replay(algorithm), stored)


def _arrays(buffer: ReplayBuffer) -> dict[str, np.ndarray[Any, Any]]:
    """Return the arrays of the replay buffer that have a row a step, (buffer_size, n_envs, …)."""
    arrays = {name: value for name, value in vars(buffer).items() if isinstance(value, np.ndarray)}
    return {name: array for name, array in arrays.items() if array.shape[:2] == (buffer.buffer_size, buffer.n_envs)}


# --- logs -----------------------------------------------------------------------------------------------------------


def _episodes(algorithm: BaseAlgorithm) -> Tensors:
    """Return what SB3's running means are taken over: a column a statistic of the last trials, and their successes."""
    infos, successes = list(algorithm.ep_info_buffer or ()), list(algorithm.ep_success_buffer or ())
    columns = {name: [info[name] for info in infos] for name in (infos[0] if infos else ())}
    return {
        "success": torch.tensor(successes, dtype=torch.float64),
        **{f"info.{name}": torch.tensor(column, dtype=torch.float64) for name, column in columns.items()},
    }


def _set_episodes(algorithm: BaseAlgorithm, stored: Tensors) -> None:
    size = algorithm._stats_window_size
    lengths = {len(tensor) if tensor.ndim == 1 else -1 for name, tensor in stored.items() if name != "success"}
    success = stored.get("success", torch.empty(0, 0))
    right = len(lengths) <= 1 and all(0 <= length <= size for length in lengths)
    right &= not lengths or {"info.r", "info.l"} <= {*stored}  # SB3 logs them
    if not right or success.ndim != 1 or len(success) > size or any(t.dtype != torch.float64 for t in stored.values()):
        raise ValueError(f"its episodes are not columns of up to {size} numbers")
    columns = {name.removeprefix("info."): t.tolist() for name, t in stored.items() if name != "success"}
    rows = zip(*columns.values(), strict=True)
    algorithm.ep_info_buffer = deque((dict(zip(columns, row, strict=True)) for row in rows), maxlen=size)
    algorithm.ep_success_buffer = deque(success.tolist(), maxlen=size)


def _log(algorithm: BaseAlgorithm) -> Tensors:
    """Return the numbers that are recorded but not written yet, and that every output is to show."""
    logger = algorithm.logger
    to_all = [name for name, excluded in logger.name_to_excluded.items() if not any(excluded or ())]
    values = {name: logger.name_to_value[name] for name in to_all}
    numbers = {name: value for name, value in values.items() if isinstance(value, int | float | np.number)}
    return {name: torch.tensor(float(value), dtype=torch.float64) for name, value in numbers.items()}


def _set_log(algorithm: BaseAlgorithm, stored: Tensors) -> None:
    fill("log", recorded := {name: torch.zeros((), dtype=torch.float64) for name in stored}, stored)
    for name, value in recorded.items():
        algorithm.logger.record(name, float(value))


# --- random streams -------------------------------------------------------------------------------------------------


def _random(algorithm: BaseAlgorithm) -> Tensors:
    return random_states(algorithm.action_space, algorithm.device)


def _set_random(algorithm: BaseAlgorithm, stored: Tensors) -> None:
    set_random_states(stored, algorithm.action_space, algorithm.device)


def _noise(algorithm: BaseAlgorithm) -> Tensors:
    """Return the state of the stream that the noise of the network's hidden units comes from, if they have any."""
    noise = _hidden_noise(algorithm)
    return {"generator": torch.from_numpy(generator_states([noise.generator]))} if noise.std else {}


def _set_noise(algorithm: BaseAlgorithm, stored: Tensors) -> None:
    fill("noise", states := _noise(algorithm), stored)
    if states:
        set_generator_states([_hidden_noise(algorithm).generator], states["generator"].numpy())


def _hidden_noise(algorithm: BaseAlgorithm) -> HiddenNoise:
    assert isinstance(algorithm.policy, MotorPolicy)
    return algorithm.policy.motor_network.noise


_PARTS: dict[str, tuple[Callable[[BaseAlgorithm], Tensors], Callable[[BaseAlgorithm, Tensors], None]]] = {
    "counter": (_counters, _set_counters),
    "optimizer": (_moments, _set_moments),
    "weights": (_weights, _set_weights),
    "environment": (_environment, _set_environment),
    "last": (_last, _set_last),
    "replay": (_replay, _set_replay),
    "episodes": (_episodes, _set_episodes),
    "log": (_log, _set_log),
    "noise": (_noise, _set_noise),
    "random": (_random, _set_random),
}
"""How each part is read and written; optimizers before the weights, the random streams last."""
