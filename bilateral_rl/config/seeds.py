"""Which seeds a command trains, as ``--seeds`` says it: how many, or the first and the last one."""

from __future__ import annotations

import re
from dataclasses import dataclass

from bilateral_rl.config.catalogue import MAX_SEEDS
from bilateral_rl.config.parse import Values
from bilateral_rl.config.schema import MAX_SEED
from bilateral_rl.io.errors import UserError

FIRST_CONFIRMING_SEED = 100
"""Seeds from here on confirm what seeds below it, of which 0 to 34 have been looked at, have suggested."""

_RANGE = re.compile(r"([0-9]{1,20})\.\.([0-9]{1,20})")
_NUMBER = re.compile(r"-?[0-9]{1,20}")


@dataclass(frozen=True)
class Seeds:
    """Consecutive seeds: how many, and the first one if it is named."""

    n: int
    first: int | None = None

    @property
    def settings(self) -> Values:
        """The settings of a training that they come to."""
        return {"seeds": self.n} if self.first is None else {"seed": self.first, "seeds": self.n}


def parse_seeds(text: str, besides: str = "") -> Seeds:
    """Read what ``--seeds`` takes: ``10`` for so many, ``100..129`` for the first and the last of them.

    Args:
        text: as given.
        besides: what else names the first seed, such as ``--seed``; empty for nothing.

    Raises:
        UserError: text of another form, no seed, too many or too large ones, or two first seeds.
    """
    if _NUMBER.fullmatch(text):
        seeds = Seeds(int(text))
    elif bounds := _RANGE.fullmatch(text):
        seeds = _between(int(bounds[1]), int(bounds[2]))
    else:
        raise UserError(
            f"--seeds takes how many, such as 10, or the first and the last one, such as 100..129, not {text!r}."
        )
    if seeds.n < 1:
        raise UserError(f"--seeds must be at least 1, got {seeds.n}.")
    if seeds.n > MAX_SEEDS:
        raise UserError(f"--seeds must be at most {MAX_SEEDS:,}, got {seeds.n:,}.")
    if besides and seeds.first is not None:
        raise UserError(f"--seeds {text} names the first seed, and so does {besides}: leave one of them out.")
    return seeds


def _between(first: int, last: int) -> Seeds:
    if last < first:
        raise UserError(f"--seeds takes the smaller seed first, as {last}..{first}, not {first}..{last}.")
    if last > MAX_SEED:
        raise UserError(f"--seeds takes seeds up to {MAX_SEED:,}, not {last:,}.")
    return Seeds(last - first + 1, first)
