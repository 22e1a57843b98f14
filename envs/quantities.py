"""Kinds of numbers that settings are made of, with their bounds; pydantic reads and refuses by them.

Numbers may also be words: YAML reads ``1e-3``, which has no point, as one.
"""

from __future__ import annotations

import contextlib
from typing import Annotated

from pydantic import BeforeValidator, ConfigDict, Field

STRICT = ConfigDict(extra="forbid")
"""The configuration of every dataclass of settings: an unknown name is an error."""


def _as_number(value: object) -> object:
    if getattr(value, "shape", None) == () and hasattr(value, "item"):  # one number of NumPy's or torch's
        value = value.item()
    if isinstance(value, bool):  # which Python counts as 0 and 1
        raise ValueError(f"must be a number, got {value}")
    if isinstance(value, str):
        with contextlib.suppress(ValueError):
            return float(value)
    return value


Whole = Annotated[int, BeforeValidator(_as_number)]
"""A whole number; 1e6 is one."""
Number = Annotated[float, BeforeValidator(_as_number), Field(allow_inf_nan=False)]
"""A finite number."""
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
