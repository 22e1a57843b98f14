"""An hour of training: does memory stay flat, do file handles stay few, do tensorboard's files stay small?

Runs ``bilateral-rl train`` in a process of its own and reads /proc once every few seconds (Linux).

    python benchmarks/soak.py --minutes 60
"""

from __future__ import annotations

import argparse
import csv
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

WARM_UP_MINUTES = 5.0
"""Growth counts from here on."""
TENTHS = "medians of the first and of the last tenth of the time after the warm-up"


def sample(pid: int, out: Path) -> dict[str, float]:
    """Resident memory (MB) and open files of a process, and the size of tensorboard's files below ``out`` (MB)."""
    process = Path("/proc") / str(pid)
    fields = dict(line.split(":", 1) for line in (process / "status").read_text().splitlines() if ":" in line)
    return {
        "resident_mb": int(fields["VmRSS"].split()[0]) / 1024,
        "open_files": len(list((process / "fd").iterdir())),
        "threads": int(fields["Threads"]),
        "tensorboard_mb": sum(path.stat().st_size for path in out.rglob("events.out.tfevents.*")) / 2**20,
        "folder_mb": sum(path.stat().st_size for path in out.rglob("*") if path.is_file()) / 2**20,
    }


def soak(arguments: list[str], minutes: float, every: float, table: Path) -> list[dict[str, float]]:
    """Train for so many minutes; write and give back the samples."""
    rows: list[dict[str, float]] = []
    with tempfile.TemporaryDirectory() as out, table.open("w", newline="") as file:
        command = [sys.executable, "-m", "bilateral_rl.commands.app", "train", *arguments, "--out", out]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        began = time.monotonic()
        while process.poll() is None and time.monotonic() - began < 60 * minutes:
            time.sleep(every)
            row = {"minutes": (time.monotonic() - began) / 60} | sample(process.pid, Path(out))
            if not rows:
                file.write(",".join(row) + "\n")
            rows.append(row)
            csv.writer(file).writerow([f"{value:.3f}" for value in row.values()])
            file.flush()
        process.send_signal(signal.SIGINT)
        try:
            process.wait(300)
        except subprocess.TimeoutExpired:
            print("the training did not stop within five minutes of Ctrl-C")
            process.kill()
    return rows


def report(rows: list[dict[str, float]]) -> None:
    """Print the curve, a dozen points of it, and the growth after the warm-up."""
    print("  ".join(f"{name:>14}" for name in rows[0]))
    for row in rows[:: max(len(rows) // 12, 1)]:
        print("  ".join(f"{value:14.1f}" for value in row.values()))
    after = [row for row in rows if row["minutes"] >= WARM_UP_MINUTES]
    if not after:
        return
    tenth = max(len(after) // 10, 1)
    for name in ("resident_mb", "open_files", "threads"):
        first, last = (statistics.median(row[name] for row in part) for part in (after[:tenth], after[-tenth:]))
        print(f"{name}: {first:.1f}, then {last:.1f} ({100 * (last / first - 1):+.2f} %), {TENTHS}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--every", type=float, default=5.0, help="seconds between samples")
    parser.add_argument("--table", type=Path, default=Path("soak.csv"), help="where the samples go")
    parser.add_argument("training", nargs="*", help="arguments of `bilateral-rl train`, after --")
    arguments = parser.parse_args()
    training = arguments.training or ["--timesteps", str(10**10)]
    report(soak(training, arguments.minutes, arguments.every, arguments.table))


if __name__ == "__main__":
    main()
