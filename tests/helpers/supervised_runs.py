"""What tests of supervised runs share: a watcher that presses Ctrl-C, and what lies in a run's folder."""

import csv
import math
import signal

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from bilateral_rl.config.parse import merge
from bilateral_rl.config.resolve import resolve
from bilateral_rl.training.progress import Progress


class Watch(Progress):
    """Remembers what it is told, and presses Ctrl-C, for real, once ``stop_at`` updates are done."""

    def __init__(self, stop_at=math.inf):
        self.started, self.steps, self.evaluations = [], [], []
        self._stop_at = stop_at

    def on_start(self, done):
        self.started.append(done)

    def on_step(self, done):
        self.steps.append(done)
        if done >= self._stop_at:
            self._stop_at = math.inf
            signal.raise_signal(signal.SIGINT)

    def on_evaluation(self, done, measures):
        self.evaluations.append((done, measures))


def with_values(config, **values):
    return resolve(None, None, [merge(config.to_values(), values)])


def table(folder):
    """The rows of ``epochs.csv`` as numbers, by seed."""
    with (folder.path / "epochs.csv").open(newline="") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    return {seed: [row for row in rows if row["seed"] == seed] for seed in sorted({int(row["seed"]) for row in rows})}


def scalars(folder, seed):
    """What tensorboard shows of a seed: by tag, (epoch, value)."""
    events = EventAccumulator(str(folder.path / f"seed_{seed}"))
    events.Reload()
    return {tag: [(e.step, e.value) for e in events.Scalars(tag)] for tag in events.Tags()["scalars"]}


def contents(folder):
    return {str(path): path.read_bytes() for path in sorted(folder.path.rglob("*")) if path.is_file()}
