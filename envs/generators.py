"""NumPy random generators as plain numbers, so that they can be saved and go on later."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_HALF = 1 << 64
_COLUMNS = 6
"""State and increment of PCG64, each as high and low half, and a half-used draw: whether there is one, and it."""


def generator_states(generators: Sequence[np.random.Generator]) -> NDArray[np.int64]:
    """Return the states (n, 6) int64 of generators that draw from PCG64; their 64-bit words keep their bits."""
    words = np.empty((len(generators), _COLUMNS), dtype=np.uint64)
    for row, generator in zip(words, generators, strict=True):
        state = generator.bit_generator.state
        inner = state["state"]
        halves = [*divmod(inner["state"], _HALF), *divmod(inner["inc"], _HALF)]
        row[:] = [*halves, state["has_uint32"], state["uinteger"]]
    return words.view(np.int64)


def set_generator_states(generators: Sequence[np.random.Generator], states: NDArray[np.int64]) -> None:
    """Put ``generators`` where those of :func:`generator_states` were.

    Raises:
        ValueError: another shape or type, or a state that PCG64 cannot be in.
    """
    shape = (len(generators), _COLUMNS)
    if states.shape != shape or states.dtype != np.int64:
        raise ValueError(f"the states of its generators are not int64 numbers of shape {shape}")
    words = np.ascontiguousarray(states).view(np.uint64)
    if (words[:, 3] % 2 == 0).any() or (words[:, 4] > 1).any() or (words[:, 5] >= 1 << 32).any():
        raise ValueError("the states of its generators are out of range")
    for generator, row in zip(generators, words.tolist(), strict=True):
        generator.bit_generator.state = {
            "bit_generator": "PCG64",
            "state": {"state": row[0] * _HALF + row[1], "inc": row[2] * _HALF + row[3]},
            "has_uint32": row[4],
            "uinteger": row[5],
        }
