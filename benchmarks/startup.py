"""Seconds from the command to its first training step, with a fresh Warp kernel cache and with a warm one."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time

FIRST_STEP = """
import sys, time
from pathlib import Path
from bilateral_rl.config.resolve import resolve
from bilateral_rl.training.session import Progress
from bilateral_rl.training.run import train

class FirstStep(Progress):
    def on_step(self, timesteps):
        print(time.time(), flush=True)
        sys.exit(0)

train(resolve(None, None), Path(sys.argv[1]), FirstStep())
"""


def seconds_to_first_step(cache: str) -> float:
    with tempfile.TemporaryDirectory() as out:
        began = time.time()
        command = [sys.executable, "-c", FIRST_STEP, out]
        environment = os.environ | {"WARP_CACHE_PATH": cache}
        done = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    return float(done.stdout.split()[-1]) - began


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as cache:
        print(f"fresh cache: {seconds_to_first_step(cache):.1f} s to the first training step")
        print(f"warm cache:  {seconds_to_first_step(cache):.1f} s")
