"""What the default command learns, how long it takes and what memory it needs, from fresh processes."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PROGRAM = (sys.executable, "-m", "bilateral_rl.commands.app")
TASKS = ("random_reach", "hold_position")


def run_once(task: str, seed: int, extra: list[str]) -> str:
    """Train by the command line, evaluate, and say what came of it."""
    with tempfile.TemporaryDirectory() as folder:
        command = [*PROGRAM, "train", "--task", task, "--seed", str(seed), "--out", folder, *extra]
        began = time.monotonic()
        training = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        _, status, usage = os.wait4(training.pid, 0)
        if status:
            raise SystemExit(f"{' '.join(command)} failed")
        minutes, memory = (time.monotonic() - began) / 60, usage.ru_maxrss / 1e6
        (run,) = Path(folder).glob("*/*/")
        table = Path(folder) / "table.json"
        subprocess.run([*PROGRAM, "evaluate", str(run), "--json", table], check=True, stdout=subprocess.DEVNULL)
        row = json.loads(table.read_text())["by_threshold_m"]["0.05"]
    return (
        f"{task:14} seed {seed}: {row['goal_completion_percent']:5.1f} % completion, "
        f"{row['time_in_goal_steps']:4.1f} steps in the goal at 5 cm, {minutes:.1f} minutes, peak {memory:.2f} GB"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--tasks", nargs="+", default=list(TASKS), choices=TASKS)
    arguments, rest = parser.parse_known_args()
    for task in arguments.tasks:
        for seed in arguments.seeds:
            print(run_once(task, seed, rest), flush=True)
