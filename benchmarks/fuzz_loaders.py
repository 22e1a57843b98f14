"""How many inputs each reader of somebody else's files was tried with, and how they ended; any fault ends it all.

python benchmarks/fuzz_loaders.py [minutes] [seed]
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "helpers"))
from loader_fuzzing import READ, REFUSED, fuzz, make_loaders  # type: ignore[import-not-found]

ROUND = 200


def main() -> None:
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 5
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    with tempfile.TemporaryDirectory() as folder:
        loaders = make_loaders(Path(folder))
        seconds = 60 * minutes / len(loaders)
        total: Counter[str] = Counter()
        print(f"{'loader':20} {'seeds':>9} {'tried':>8} {READ:>8} {REFUSED:>8}")
        for loader in loaders:
            outcomes: Counter[str] = Counter()
            began, number = time.monotonic(), first
            while time.monotonic() - began < seconds:
                outcomes += fuzz(loader, ROUND, number)
                number += 1
            seeds = f"{first}-{number - 1}"
            tried = outcomes.total()
            print(f"{loader.name:20} {seeds:>9} {tried:>8,} {outcomes[READ]:>8,} {outcomes[REFUSED]:>8,}", flush=True)
            total += outcomes
        print(f"{'all':20} {'':>9} {total.total():>8,} {total[READ]:>8,} {total[REFUSED]:>8,}")


if __name__ == "__main__":
    main()
