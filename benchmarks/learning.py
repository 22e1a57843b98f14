"""What the defaults learn, how long it takes, and what each side has of it: one training at a time, on one core.

    python benchmarks/learning.py --algo sac --models cc_s cc_ns stock --seeds 0 1 2 --against OTHER_CHECKOUT

trains by ``bilateral-rl train`` in a fresh process for each row, and writes the row as soon as it has it; rows that a
call before has written are not made again. With ``--against``, the default PPO of another checkout trains after each
row, turn about, so that times may be compared on a machine that drifts. ``--variants`` are settings that are trained
side by side, as in ``--variants "" "ppo.action_traces=[0.5,0.8] evaluation.every=100000"``. The model "stock" is SB3's
own SAC or TD3 (``stock_off_policy.py``).
"""

from __future__ import annotations

import argparse
import itertools
import math
import os
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import pandas as pd
from learning_measures import RADIUS, measures_of, progress, result_of
from stock_off_policy import train as train_stock

from bilateral_rl.config.parse import parse_overrides
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import RLConfig
from bilateral_rl.runs.folder import RunFolder

HERE = Path(__file__).parents[1]
TASKS = ("random_reach", "hold_position")
STOCK = "stock"
Values = dict[str, str | float]


class Case(NamedTuple):
    """What one row is of."""

    algo: str
    model: str
    task: str
    seed: int
    variant: str
    """Settings over the defaults, with spaces between them."""


COLUMNS = (
    *Case._fields, "result", "minutes", "cpu_minutes", "steps", "memory_gb", "steps_to_90", "minutes_to_90",
    "largest_fall", "share_dominant", "share_non_dominant", "weight_dominant", "weight_non_dominant",
    "alone_dominant", "alone_dominant_fresh", "alone_non_dominant", "alone_non_dominant_fresh",
    "against_minutes", "against_cpu_minutes",
)  # fmt: skip
"""Columns of the file. ``result`` is completed reaches (%), or steps of a hold within the goal; ``alone_…`` is in the
same unit, ``share_…`` a side's part of the modulation (%). ``minutes`` are those of the clock, ``cpu_minutes`` those
that the process was at work."""


# --- training ---------------------------------------------------------------------------------------------------------


def program(checkout: Path) -> list[str]:
    """The command line of a checkout, whatever module of it that is in."""
    scripts = tomllib.loads((checkout / "pyproject.toml").read_text(encoding="utf-8"))["project"]["scripts"]
    module, _, function = scripts["bilateral-rl"].partition(":")
    return [sys.executable, "-c", f"from {module} import {function}; {function}()"]


def timed(command: Sequence[str], checkout: Path) -> Values:
    """Run a command of a checkout on one thread: its minutes and its peak of memory."""
    environment = os.environ | {"PYTHONPATH": str(checkout), "OMP_NUM_THREADS": "1"}
    began = time.monotonic()
    process = subprocess.Popen(command, cwd=checkout, env=environment, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(command)} failed.")
    cpu = usage.ru_utime + usage.ru_stime
    return {"minutes": (time.monotonic() - began) / 60, "cpu_minutes": cpu / 60, "memory_gb": usage.ru_maxrss / 1e6}


def train_ours(case: Case, out: Path) -> Values:
    """Train by the command line into a folder below ``out``, and measure the run."""
    command = [*program(HERE), "train", "--algo", case.algo, "--model", case.model, "--task", case.task]
    command += ["--seed", str(case.seed), "--out", str(out.resolve())]
    command += [word for setting in case.variant.split() for word in ("--set", setting)]
    times = timed(command, HERE)
    newest = max((out / case.task).glob(f"{case.model}-{case.algo}-*/"), key=lambda folder: folder.stat().st_mtime)
    folder = RunFolder.open(newest)
    return times | {"steps": folder.status()["timesteps"]} | measures_of(folder)


def train_peer(case: Case) -> Values:
    """Train stock SB3 in this process, and measure it."""
    layers = [parse_overrides(case.variant.split()), {"seed": case.seed}]
    config = resolve(case.algo, case.task, layers)
    assert isinstance(config, RLConfig)
    began, cpu = time.monotonic(), time.process_time()
    record, rows = train_stock(config)
    times = {"minutes": (time.monotonic() - began) / 60, "cpu_minutes": (time.process_time() - cpu) / 60}
    along = pd.DataFrame(rows)
    measures = progress(along, case.task, config.trial)
    learned = along.loc[along["timesteps"] >= measures["steps_to_90"], "seconds"]
    measures["minutes_to_90"] = float(learned.iloc[0]) / 60 if len(learned) else math.nan
    return times | {"steps": float(along["timesteps"].iloc[-1]), "result": result_of(record, case.task)} | measures


def train_against(checkout: Path, task: str, seed: int) -> Values:
    """Train the default PPO of another checkout: its minutes."""
    with tempfile.TemporaryDirectory() as folder:
        command = [*program(checkout), "train", "--task", task, "--seed", str(seed), "--out", folder]
        times = timed(command, checkout.resolve())
    return {f"against_{name}": times[name] for name in ("minutes", "cpu_minutes")}


def row_of(case: Case, runs: Path | None, against: Path | None) -> Values:
    """Train and measure one row; the run is kept below ``runs`` if that is given."""
    if case.model == STOCK:
        row = train_peer(case)
    else:
        with tempfile.TemporaryDirectory() as temporary:
            row = train_ours(case, runs or Path(temporary))
    if against:
        row |= train_against(against, case.task, case.seed)
    return case._asdict() | row


# --- the table --------------------------------------------------------------------------------------------------------


def read(path: Path) -> pd.DataFrame:
    """The rows of the file so far."""
    if not path.exists():
        return pd.DataFrame(columns=list(COLUMNS))
    return pd.read_csv(path, keep_default_na=False, na_values=["nan"], dtype={"variant": str})


def append(path: Path, row: Mapping[str, str | float]) -> None:
    """Add a row to the file; what it has no value for is "nan"."""
    frame = pd.DataFrame([row]).reindex(columns=list(COLUMNS))
    path.parent.mkdir(parents=True, exist_ok=True)
    frame.to_csv(path, mode="a", header=not path.exists(), index=False, na_rep="nan", float_format="%.6g")


def missing(cases: Sequence[Case], table: pd.DataFrame) -> Iterator[Case]:
    """Those of the cases that the table has no row of."""
    done = {Case(*row) for row in table[list(Case._fields)].itertuples(index=False)}
    return (case for case in cases if case not in done)


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """A row for the seeds of each algorithm, model, task and variant: means, and the worst of what may go wrong."""
    table = table.assign(
        ratio=table["minutes"] / table["against_minutes"],
        gain_dominant=table["alone_dominant"] - table["alone_dominant_fresh"],
        gain_non_dominant=table["alone_non_dominant"] - table["alone_non_dominant_fresh"],
    )
    return (
        table.groupby(["task", "algo", "model", "variant"], sort=False)
        .agg(
            seeds=("seed", "count"),
            mean=("result", "mean"),
            worst=("result", "min"),
            minutes=("minutes", "mean"),
            cpu_min=("cpu_minutes", "mean"),
            ratio=("ratio", "mean"),
            fall=("largest_fall", "max"),
            Msteps=("steps", lambda steps: steps.mean() / 1e6),
            Msteps90=("steps_to_90", lambda steps: steps.mean() / 1e6),
            min90=("minutes_to_90", "mean"),
            share_d=("share_dominant", "mean"),
            share_n=("share_non_dominant", "mean"),
            least_d=("share_dominant", "min"),
            least_n=("share_non_dominant", "min"),
            w_d=("weight_dominant", "min"),
            w_n=("weight_non_dominant", "min"),
            alone_d=("alone_dominant", "mean"),
            alone_n=("alone_non_dominant", "mean"),
            gain_d=("gain_dominant", "mean"),
            gain_n=("gain_non_dominant", "mean"),
        )
        .reset_index()
    )


LEGEND = f"""\
mean, worst: completed reaches (%), or steps of 50 of a hold, within {100 * RADIUS:g} cm. ratio: minutes over those of
the other checkout's default PPO. fall: the largest on the way, in points. Msteps90, min90: million steps and minutes to
90 % on the evaluations' trials, of the seeds that came there. share: each side's part of the modulation at the end (%),
least: in the worst seed. w: the smallest combination weight. alone: after a deep lesion of the other side and one epoch
of everything; gain: over a fresh network's."""


def shown(frame: pd.DataFrame) -> str:
    return frame.dropna(axis=1, how="all").to_string(index=False, float_format=lambda value: f"{value:.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--algo", default="ppo")
    parser.add_argument("--models", nargs="+", default=["cc_s"], help=f"{STOCK} is SB3's own SAC or TD3")
    parser.add_argument("--tasks", nargs="+", default=list(TASKS), choices=TASKS)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--variants", nargs="+", default=[""], help="settings, with spaces between them")
    parser.add_argument("--against", type=Path, help="another checkout, whose default PPO trains turn about")
    parser.add_argument("--out", type=Path, default=Path("learning.csv"))
    parser.add_argument("--runs", type=Path, help="folder of the runs; by default they are thrown away")
    given = parser.parse_args()
    cases = itertools.product(given.tasks, given.seeds, given.variants, given.models)
    wanted = [Case(given.algo, model, task, seed, variant) for task, seed, variant, model in cases]
    for case in missing(wanted, read(given.out)):
        row = row_of(case, given.runs, given.against)
        append(given.out, row)
        print(" ".join(map(str, case)), f"{row['result']:.1f} in {row['minutes']:.1f} minutes", flush=True)
    print(shown(summary(read(given.out))), LEGEND, sep="\n\n")


if __name__ == "__main__":
    main()
