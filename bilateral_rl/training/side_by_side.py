"""Reinforcement learning of several networks: a training for each seed, side by side over the cores.

Each is a run of its own in the folder ``seed_<n>`` of the run, in a process of its own, and ends with the bits that it
would have alone. The run itself holds what all commands read: the weights of all seeds, stacked as in supervised runs,
and one table of evaluations.
"""

from __future__ import annotations

import contextlib
import csv
import dataclasses
import io
import json
import os
import queue
import shutil
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import torch

from bilateral_rl.analysis.block_table import BLOCKS
from bilateral_rl.config.schema import RLConfig
from bilateral_rl.io.cpus import usable_cpus
from bilateral_rl.io.tensors import Tensors
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.runs.folder import BEST, FAILED, FINAL, FINISHED, RunFolder
from bilateral_rl.runs.policies import load_policies, stack_states
from bilateral_rl.training.learner import Diverged, Learner, Moment, Watcher

Event = tuple[int, dict[str, Any] | None]
"""A seed and its message; None at the end of its process."""

_WAIT = 0.1
"""Seconds after which to see whether somebody wants to stop, at the latest."""


class SideBySideLearner(Learner):
    """Trains every seed of a run in a process of its own, as many at a time as there are cores.

    Args:
        config: of the training.
        folder: of the run.
        at_once: how many seeds train at a time; None for as many as there are cores.
    """

    evaluation_every = 0

    def __init__(self, config: RLConfig, folder: RunFolder, at_once: int | None = None) -> None:
        self._config, self._folder = config, folder
        self._at_once = at_once or max(1, usable_cpus() // config.threads)
        self.checkpoint_every = config.evaluation.checkpoint_every
        self._done = dict.fromkeys(config.all_seeds, 0)
        self._notes: dict[int, list[str]] = {}
        self._evaluations: list[dict[str, float]] = []

    @property
    def done(self) -> int:
        return sum(self._done.values())

    @property
    def finished(self) -> bool:
        return all(self._is_finished(seed) for seed in self._done)

    def why_finished(self) -> str:
        return (
            f"has done the {self._config.timesteps:,} steps of every seed; give a larger --timesteps to train further"
        )

    def state(self) -> Tensors:
        return {"seeds": torch.tensor(self._config.all_seeds), "done": torch.tensor(list(self._done.values()))}

    def load(self, state: Tensors) -> None:
        expected = torch.tensor(self._config.all_seeds)
        if sorted(state) != ["done", "seeds"] or not torch.equal(state["seeds"], expected):
            raise ValueError("it is not about the seeds of its run")
        for seed in self._done:
            if (self._child(seed).path / "config.yaml").is_file():
                self._done[seed] = self._child(seed).status().get("timesteps", 0)

    def status(self, run_state: str) -> dict[str, Any]:
        seeds = [
            {"seed": seed, "state": self._child_status(seed).get("state", "waiting"), "timesteps": done}
            for seed, done in self._done.items()
        ]
        return {"timesteps": max(self._done.values()), "seeds": seeds}

    def weights(self, moment: Moment) -> dict[str, Tensors]:
        """Return what every seed has come to at the end; nothing before it, or if one of them has no weights yet."""
        return {name: stacked for name in (FINAL, BEST) if moment == "end" and (stacked := self._stacked(name))}

    def best(self) -> Tensors:
        return {}

    def policies(self) -> dict[int, MotorPolicy]:
        return load_policies(self._folder) if FINAL in self._folder.weight_names() else {}

    def open(self, folder: RunFolder) -> None:
        """Make the folders of the seeds, and let those that go on know the end that the run sets."""
        for seed in self._done:
            child, config = self._child(seed), self._config_of(seed)
            if child.is_saved:
                child.write_config(config)
            else:  # it was never saved
                shutil.rmtree(child.path, ignore_errors=True)
                child.begin(config)

    def close(self) -> None:
        """There is nothing to close: no process outlives :meth:`learn`."""

    def learn(self, watcher: Watcher) -> bool:
        waiting = [seed for seed in self._done if not self._is_finished(seed)]
        running: dict[int, _SeedProcess] = {}
        events: queue.Queue[Event] = queue.Queue()
        goes_on = watcher.between()
        try:
            while running or (goes_on and waiting):
                while goes_on and waiting and len(running) < self._at_once:
                    seed = waiting.pop(0)
                    running[seed] = _SeedProcess(seed, self._child(seed).path, events)
                with contextlib.suppress(queue.Empty):
                    seed, message = events.get(timeout=_WAIT)
                    if message is None:
                        self._end(seed, running.pop(seed), is_asked=not goes_on)
                    else:
                        self._hear(seed, message, watcher)
                if goes_on and not watcher.step(self.done):
                    goes_on = False
                    for process in running.values():
                        process.stop()
        finally:
            for process in running.values():
                process.kill()
        if all(self._child_status(seed).get("state") == FAILED for seed in self._done):
            raise Diverged(" ".join(self.notes()))
        return all(self._is_over(seed) for seed in self._done)

    def evaluate(self) -> tuple[dict[str, float], bool]:
        """Pass on what one of the seeds has measured, and keep its best to itself."""
        return self._evaluations.pop(0) if self._evaluations else {}, False

    def write_tables(self, folder: RunFolder) -> None:
        """Write each table of the seeds in one, one seed below the other, with a column ``seed``."""
        for name in ("evaluations.csv", BLOCKS):
            self._write_table(folder, name)

    def _write_table(self, folder: RunFolder, name: str) -> None:
        rows: list[dict[str, Any]] = []
        for seed in self._done:
            path = self._child(seed).path / name
            if path.is_file():
                with path.open(newline="", encoding="utf-8") as file:
                    rows += [{"seed": seed, **row} for row in csv.DictReader(file)]
        if rows:
            text = io.StringIO()
            # Seeds that were begun by an earlier version may lack columns.
            columns = dict.fromkeys(name for row in rows for name in row)
            writer = csv.DictWriter(text, list(columns), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
            folder.write_text(name, text.getvalue())

    def notes(self) -> list[str]:
        return [note for seed in self._done for note in self._notes.get(seed, [])]

    def _hear(self, seed: int, message: dict[str, Any], watcher: Watcher) -> None:
        self._done[seed] = message.get("done", self._done[seed])
        if "measures" in message:
            self._evaluations.append({"seed": seed, **message["measures"]})
            watcher.between()
        self._notes.setdefault(seed, []).extend(f"Seed {seed}: {note}" for note in message.get("notes", ()))
        if "error" in message:
            self._notes[seed].append(f"Seed {seed} failed: {message['error']}")

    def _end(self, seed: int, process: _SeedProcess, is_asked: bool) -> None:
        code, notes = process.code, self._notes.setdefault(seed, [])
        self._done[seed] = self._child_status(seed).get("timesteps", 0)  # what is saved, said or not
        if not (self._is_over(seed) or is_asked or notes):  # killed, or a fault of the program, which it has printed
            notes.append(f"The process of seed {seed} ended early, with exit code {code}.")

    def _is_finished(self, seed: int) -> bool:
        return self._done[seed] >= self._config.timesteps and self._child_status(seed).get("state") == FINISHED

    def _is_over(self, seed: int) -> bool:
        """Whether nothing is left to do for a seed: one that diverged keeps its last weights, as in supervised runs."""
        return self._is_finished(seed) or self._child_status(seed).get("state") == FAILED

    def _child(self, seed: int) -> RunFolder:
        return RunFolder(self._folder.path / f"seed_{seed}")

    def _child_status(self, seed: int) -> dict[str, Any]:
        return self._child(seed).status()

    def _config_of(self, seed: int) -> RLConfig:
        return dataclasses.replace(self._config, seed=seed, seeds=1)

    def _stacked(self, name: str) -> Tensors:
        """Return the weights ``name`` of all seeds; those of a seed that failed are the last ones that it saved."""
        states: dict[int, Tensors] = {}
        for seed in self._done:
            child = self._child(seed)
            available = [n for n in (name, child.status().get("weights", ""), BEST) if n in child.weight_names()]
            if not available:
                return {}
            states[seed] = child.load_weights(available[0])
        return stack_states(states)


class _SeedProcess:
    """The process of one seed, and a thread that hears it."""

    def __init__(self, seed: int, folder: Path, events: queue.Queue[Event]) -> None:
        # It is of a session of its own, so that Ctrl-C reaches it through this process alone.
        apart: dict[str, Any] = {"start_new_session": True}
        if sys.platform == "win32":
            apart = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "bilateral_rl.training.one_seed", str(folder.resolve())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            env=os.environ | {"PYTHONPATH": os.pathsep.join(path or str(Path.cwd()) for path in sys.path)},
            **apart,
        )
        threading.Thread(target=self._listen, args=(seed, events), daemon=True).start()

    @property
    def code(self) -> int:
        """The exit code, once it has ended."""
        return self._process.wait()

    def stop(self) -> None:
        """Ask it to save and stop."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):
            self._process.stdin.close()

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()
        self._process.wait()

    def _listen(self, seed: int, events: queue.Queue[Event]) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            with contextlib.suppress(ValueError):  # cut off by its end
                events.put((seed, json.loads(line)))
        events.put((seed, None))
