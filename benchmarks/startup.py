"""CPU seconds of ``--help`` and ``list``, and seconds from the command to its first training step (Linux, macOS).

CPU seconds say more than seconds on a busy machine; the best of a few rounds says what the code can do.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time

ROUNDS = 5
COMMANDS = ("--help", "list", "train --help")
GOALS = {"--help": 0.5, "list": 1.0}
"""CPU seconds within which a command answers."""

FIRST_STEP = """
import sys, time
from pathlib import Path
from bilateral_rl.config.resolve import resolve
from bilateral_rl.training.progress import Progress
from bilateral_rl.training.run import train

class FirstStep(Progress):
    def on_step(self, timesteps):
        print(time.time(), flush=True)
        sys.exit(0)

train(resolve(None, None), Path(sys.argv[1]), FirstStep())
"""


def cpu_seconds(arguments: str) -> float:
    """CPU time of a command, its user and system time together."""
    with tempfile.TemporaryDirectory() as folder:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [sys.executable, "-m", "bilateral_rl.commands.app", *arguments.split()]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, cwd=folder)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def seconds_to_first_step(cache: str) -> float:
    """Time on the clock until a training has done its first step."""
    with tempfile.TemporaryDirectory() as out:
        began = time.time()
        command = [sys.executable, "-c", FIRST_STEP, out]
        environment = os.environ | {"WARP_CACHE_PATH": cache}
        done = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    return float(done.stdout.split()[-1]) - began


if __name__ == "__main__":
    for arguments in COMMANDS:
        best = min(cpu_seconds(arguments) for _ in range(ROUNDS))
        goal = f" (goal: {GOALS[arguments]} s)" if arguments in GOALS else ""
        print(f"bilateral-rl {arguments}: {best:.2f} s of CPU time{goal}")
    with tempfile.TemporaryDirectory() as cache:
        print(f"fresh cache: {seconds_to_first_step(cache):.1f} s to the first training step")
        print(f"warm cache:  {seconds_to_first_step(cache):.1f} s")
