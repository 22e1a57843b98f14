"""Seeds in words, the same everywhere. Numbers of studies are in :mod:`bilateral_rl.analysis.formats`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def seed_range(seeds: Sequence[int]) -> str:
    """Consecutive seeds by number: "seed 3" or "seeds 0 to 9"."""
    return f"seed {seeds[0]}" if len(seeds) == 1 else f"seeds {min(seeds)} to {max(seeds)}"


def seed_counts(counts: Iterable[int]) -> str:
    """How many seeds there are of each thing: "1 seed", "10 seeds" or "3 to 10 seeds"."""
    counts = list(counts)
    few, many = min(counts, default=0), max(counts, default=0)
    return f"{few} to {many} seeds" if few < many else f"{many} seed{'s' * (many != 1)}"
