"""What one reading of the paper makes of its claims."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from bilateral_rl.claims.claim import Claim


@dataclass(frozen=True)
class Judgement:
    """The claims as one reading of the paper judges them, and what the reading is."""

    reading: str
    """Name of the reading."""
    claims: Sequence[Claim]
    """C1 to C14, or B1 to B6 of two arms, in this order."""
    anchor: str | None = None
    """Name of the reading from which it deviates, by one choice; None if it is an anchor itself."""
    choices: Mapping[str, str] = field(default_factory=dict)
    """What it chooses for each gap of the paper, in words; readings of one study name the gaps alike."""
    why: str = ""
    """Why anyone would read the paper so."""
    source: str = ""
    """What that rests on."""
    note: str = ""
    """What must be known of all its numbers; "" if nothing."""
