"""The doors' inputs are tried in processes of their own, whose kernels assert that every index lies inside its array.

An access out of bounds ends the process (Warp's mode "debug"). Each input is noted before it is tried, so that the one
that ended it is known.

    python tests/helpers/door_fuzzing.py INPUTS CHILDREN [FIRST]
"""

from __future__ import annotations

import mmap
import multiprocessing
import pickle
import signal
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import warp as wp
from hypothesis import HealthCheck, Phase, given, seed, settings
from public_doors import REFUSED, WORKS, Door, make_doors, trap

SECONDS = 30
"""That no input may take."""
NOTE = 4096
"""Bytes that describe an input."""


def use_asserting_kernels() -> None:
    """Let kernels assert that every index lies inside its array; before anything loads them."""
    wp.config.mode = "debug"
    # Else Warp's own assertions read the stack of another thread, where threads share a kernel.
    wp.config.enable_tiles_in_stack_memory = False


def try_doors(doors: dict[str, Door], n: int, number: int, note: mmap.mmap) -> Counter[tuple[str, str]]:
    """How many of ``n`` inputs of the random stream ``number``, dealt to the doors in turn, ended how."""
    outcomes: Counter[tuple[str, str]] = Counter()
    for i, name in enumerate(doors):
        _try_door(doors[name], name, n // len(doors) + (i < n % len(doors)), number, note, outcomes)
    return outcomes


def _try_door(door: Door, name: str, n: int, number: int, note: mmap.mmap, outcomes: Counter[tuple[str, str]]) -> None:
    @seed(number)
    @settings(
        max_examples=n,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(door.inputs)
    def run(arguments: tuple[Any, ...]) -> None:
        described = f"{name}, stream {number}: {arguments!r}".encode(errors="replace")
        note[:] = described[:NOTE].ljust(NOTE)
        signal.alarm(SECONDS)
        outcomes[name, door.outcome(arguments)] += 1
        signal.alarm(0)

    run()


def in_child(doors: dict[str, Door], n: int, number: int, folder: Path) -> Counter[tuple[str, str]]:
    """:func:`try_doors` in a copy of this process.

    Raises:
        ChildProcessError: the copy ended otherwise than by itself; the message says how, and on which input.
    """
    note, result = mmap.mmap(-1, NOTE), folder / f"result-{number}"  # memory that both processes see, and a file

    def run() -> None:
        result.write_bytes(pickle.dumps(try_doors(doors, n, number, note)))

    child = multiprocessing.get_context("fork").Process(target=run)
    child.start()
    child.join()
    if child.exitcode != 0:
        raise ChildProcessError(f"a process ended with {child.exitcode} on {note[:].decode(errors='replace').strip()}")
    outcomes: Counter[tuple[str, str]] = pickle.loads(result.read_bytes())
    result.unlink()
    return outcomes


def main() -> None:
    n, children, *first = map(int, sys.argv[1:])
    use_asserting_kernels()
    outcomes: Counter[tuple[str, str]] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        doors = make_doors(), make_doors(noise=0.1, rich=True), make_doors(noise=0.1)
        try:
            in_child({"a trap": trap()}, 1, 0, Path(folder))
        except ChildProcessError as ended:
            print(f"as it should, {ended}", flush=True)
        else:
            raise AssertionError("an access out of bounds went by")
        for number in range(*first or [0], sum(first) + children):
            outcomes += in_child(doors[number % len(doors)], n, number, Path(folder))
            print(f"{number + 1 - sum(first):,} processes, {outcomes.total():,} inputs", file=sys.stderr, flush=True)
    print(f"{'door':30} {WORKS:>9} {REFUSED:>9}")
    for name in doors[0]:
        print(f"{name:30} {outcomes[name, WORKS]:>9,} {outcomes[name, REFUSED]:>9,}")


if __name__ == "__main__":
    main()
