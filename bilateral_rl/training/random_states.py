"""The random streams that a training draws from, as plain tensors: torch's, NumPy's, Python's, the action space's."""

from __future__ import annotations

import random
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from torch import Tensor

from bilateral_rl.envs.generators import generator_states, set_generator_states

_TWISTER_WORDS = 624
"""Length of the key of the Mersenne Twister, which NumPy's global stream and Python's both are."""


def random_states(action_space: spaces.Space[Any], device: torch.device) -> dict[str, Tensor]:
    """Return the state of every random stream by name."""
    numpy = np.random.get_state(legacy=False)  # noqa: NPY002 - SB3's random stream
    assert isinstance(numpy, dict)
    _, python, python_gauss = random.getstate()
    states = {
        "torch": torch.get_rng_state(),
        "numpy": _twister([*numpy["state"]["key"].tolist(), numpy["state"]["pos"]]),
        "numpy_gauss": _gauss(numpy["gauss"] if numpy["has_gauss"] else None),
        "python": _twister(python),
        "python_gauss": _gauss(python_gauss),
        "action_space": torch.from_numpy(generator_states([action_space.np_random])),
    }
    return states | ({"cuda": torch.cuda.get_rng_state(device)} if device.type == "cuda" else {})


def set_random_states(states: Mapping[str, Tensor], action_space: spaces.Space[Any], device: torch.device) -> None:
    """Put every stream where :func:`random_states` found it; a CUDA device's only if it was on one then.

    Raises:
        ValueError: the tensors are not such states.
    """
    expected = random_states(action_space, device)
    if sorted({*states} - {"cuda"}) != sorted({*expected} - {"cuda"}):
        raise ValueError(f"random must hold {', '.join(expected)}")
    numpy, python = _words("numpy", states["numpy"]), _words("python", states["python"])
    numpy_gauss, python_gauss = _gauss_of("numpy_gauss", states), _gauss_of("python_gauss", states)
    set_generator_states([action_space.np_random], states["action_space"].numpy())
    try:
        torch.set_rng_state(states["torch"])
        if "cuda" in states and device.type == "cuda":
            torch.cuda.set_rng_state(states["cuda"], device)
    except (RuntimeError, TypeError) as error:
        raise ValueError(f"random.torch is no state of torch: {error}") from None
    state = {"key": np.array(numpy[:-1], dtype=np.uint32), "pos": numpy[-1]}
    gauss = {"has_gauss": int(numpy_gauss is not None), "gauss": numpy_gauss or 0.0}
    np.random.set_state({"bit_generator": "MT19937", "state": state, **gauss})  # noqa: NPY002
    random.setstate((3, tuple(python), python_gauss))


def _twister(words: list[int] | tuple[int, ...]) -> Tensor:
    return torch.tensor(words, dtype=torch.int64)


def _words(name: str, tensor: Tensor) -> list[int]:
    """Return the 624 words of the key, and the position in it. Raises ValueError for anything else."""
    if tensor.dtype != torch.int64 or tensor.shape != (_TWISTER_WORDS + 1,):
        raise ValueError(f"random.{name} is not an int64 tensor of shape ({_TWISTER_WORDS + 1},)")
    *key, position = tensor.tolist()
    if min(key) < 0 or max(key) >= 1 << 32 or not 0 <= position <= _TWISTER_WORDS:
        raise ValueError(f"random.{name} is out of range")
    return [*key, position]


def _gauss(value: float | None) -> Tensor:
    """Return the second of a pair of Gaussian numbers, (1,), if it has not been drawn yet, or else (0,)."""
    return torch.tensor([] if value is None else [value], dtype=torch.float64)


def _gauss_of(name: str, states: Mapping[str, Tensor]) -> float | None:
    tensor = states[name]
    if tensor.dtype != torch.float64 or tensor.ndim != 1 or len(tensor) > 1:
        raise ValueError(f"random.{name} is not a float64 tensor of one number at most")
    return float(tensor) if len(tensor) else None
