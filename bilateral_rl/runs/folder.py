"""The folder of one training run: what is in it, written whole or not at all, read without executing anything."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.envs.experiments.files import is_file
from bilateral_rl.io import files, locks
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import replacing
from bilateral_rl.io.yaml_files import read_settings
from bilateral_rl.runs.versions import versions

if TYPE_CHECKING:
    from bilateral_rl.io.tensors import Tensors

FINAL, BEST = "final", "best"
"""The names of a run's weights at its end and at its best evaluation."""
RESUME = "resume.safetensors"
"""The file from which a training goes on."""
RUNNING, FINISHED, INTERRUPTED, FAILED, IMPORTED = "running", "finished", "interrupted", "failed", "imported"
"""The states of a run, as ``status.json`` names them."""
_LARGEST_JSON, _LARGEST_WEIGHTS, _LARGEST_RESUME = 2**20, 2**30, 2**32
"""Largest files that are read, in bytes: no configuration within bounds makes larger ones."""
_LARGEST_COUNT = 2**63 - 1
"""The largest number of steps, epochs or updates that ``status.json`` may name: torch and NumPy hold no larger one."""
_STATUS_TYPES = {"state": str, "timesteps": int, "epochs": int, "updates": int, "weights": str, "seeds": list}


@dataclass(frozen=True)
class RunFolder:
    """The folder of a run, ``<out>/<task>/<model>-<algo>-<n>/``.

    Somebody else may have made it: whatever is read here lies in the folder, is of a size that it can have, and is
    data that is never executed.
    """

    path: Path
    """The folder, with ``config.yaml`` in it."""

    @classmethod
    def create(cls, out: Path, config: TrainConfig) -> RunFolder:
        """Make the next free folder below ``out``, and write the configuration and versions into it.

        Raises:
            UserError: the folder or a file of it cannot be written; then nothing is left.
        """
        parent = out / config.task_folder
        try:
            parent.mkdir(parents=True, exist_ok=True)
            folder = cls(_next_free(parent, f"{config.model}-{config.algo}"))
            with files.removed_if_it_fails(folder.path):
                folder.begin(config)
        except OSError as error:
            raise UserError(f"Cannot write a run under {out}: {error.strerror}. Choose another --out.") from None
        return folder

    def begin(self, config: TrainConfig) -> None:
        """Make the folder if need be, and write the configuration and versions. Raises OSError if it cannot."""
        (self.path / "weights").mkdir(parents=True, exist_ok=True)
        self.write_config(config)
        self.write_json("versions.json", versions())

    @classmethod
    def open(cls, path: Path) -> RunFolder:
        """Open an existing run.

        Raises:
            UserError: there is nothing at ``path``, or something that is no run.
        """
        try:
            is_folder, is_zip = path.is_dir(), path.suffix.lower() == ".zip" and path.is_file()
            is_run = (path / "config.yaml").is_file()
        except OSError as error:
            raise UserError(f"There is no run {path}: {error.strerror}.") from None
        if is_zip:
            raise UserError(f"{path} is no run but a model; make one of it with `bilateral-rl import`.")
        if not is_folder:
            where = "" if path.is_absolute() else f" in {Path.cwd()}"
            raise UserError(f"There is no run {path}{where}; `bilateral-rl list` shows those there are.")
        if not is_run:
            raise UserError(f"{path} is not a run: it has no config.yaml. `bilateral-rl list` shows those there are.")
        return cls(path)

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """A context in which this process alone trains into the folder; however the process ends, so does the lock.

        Temporary files that a killed training left there are removed.

        Raises:
            UserError: another training holds the lock, or the folder cannot be written, or not without harm to other
                things (:func:`bilateral_rl.io.files.refuse_traps`).
        """
        files.refuse_traps(self.path)
        lock = self.path / ".lock"
        with contextlib.ExitStack() as stack:
            try:
                stack.enter_context(locks.locked(lock))
            except TimeoutError:
                raise UserError(
                    f"Another training is writing into {self.path}; wait for its end, or stop it. If there is none on "
                    f"any machine, remove {lock}."
                ) from None
            except OSError as error:
                raise UserError(f"Cannot write {self.path}: {error.strerror}.") from None
            for folder in (self.path, self.path / "weights"):  # runs of seeds below have locks of their own
                files.remove_left_over(folder)
            yield

    def write_config(self, config: TrainConfig) -> None:
        """Write ``config.yaml``."""
        self.write_text("config.yaml", yaml.safe_dump(config.to_values(), sort_keys=False))

    def config(self) -> TrainConfig:
        """Read the resolved configuration. Raises UserError if it is damaged."""
        values = read_settings(self.path / "config.yaml", within=self.path)
        task = values.get("task")
        if isinstance(task, str) and is_file(task) and not values.get("experiment"):  # which may lie anywhere
            raise UserError(
                f"{self.path / 'config.yaml'} describes no training: its task is the file of an experiment."
            )
        try:
            return resolve(None, None, [values])
        except UserError as error:
            raise UserError(f"{self.path / 'config.yaml'} describes no training: {error}") from None

    def status(self) -> dict[str, Any]:
        """Read ``status.json``: the state, the weights and how far the training came; empty if it was never saved.

        Raises:
            UserError: the file is damaged.
        """
        status = self.read_json("status.json", default={})
        if not (isinstance(status, dict) and all(map(_makes_sense, status, status.values()))):
            raise UserError(f"{self.path / 'status.json'} is damaged: it does not say how far the training came.")
        return status

    def save_weights(self, name: str, tensors: Tensors) -> None:
        """Write ``weights/<name>.safetensors``, whole or not at all. Raises OSError."""
        self._write_tensors(f"weights/{name}.safetensors", tensors)

    def load_weights(self, name: str) -> Tensors:
        """Read ``weights/<name>.safetensors``. Raises UserError if it is missing, damaged or not finite."""
        from bilateral_rl.io import tensors as tensor_files  # torch, which listing runs does without

        names = self.weight_names()
        path = self.path / "weights" / f"{name}.safetensors"
        try:
            if name not in names:  # which keeps out names that lead elsewhere
                raise FileNotFoundError
            tensors = tensor_files.load(path, _LARGEST_WEIGHTS, within=self.path)
        except FileNotFoundError:
            sentence = f"{path} does not exist; the run's weights are: {', '.join(names) or 'none'}."
            if name == FINAL and self.status().get("state") == RUNNING:
                sentence += " It is still training, or was killed."
            raise UserError(sentence) from None
        broken = [key for key, tensor in tensors.items() if tensor.is_floating_point() and not tensor.isfinite().all()]
        if broken:
            raise UserError(f"The weights {name} of {self.path} are not finite numbers in {', '.join(broken)}.")
        return tensors

    def weights_hash(self, name: str) -> str:
        """Say in 16 characters which weights these are, for results that must tell when they are of others.

        The hash is that of the tensors' names, types, shapes and values, however the file arranges them.

        Raises:
            UserError: the weights are missing, damaged or not finite.
        """
        from bilateral_rl.io import tensors as tensor_files  # torch, which listing runs does without

        return tensor_files.content_hash(self.load_weights(name))

    def weight_names(self) -> list[str]:
        """List the names that :meth:`load_weights` takes."""
        return sorted(path.stem for path in (self.path / "weights").glob("*.safetensors"))

    @property
    def is_saved(self) -> bool:
        """Whether its training was saved before it stopped, so that it can go on."""
        return (self.path / RESUME).is_file()

    def save_resume(self, tensors: Tensors) -> None:
        """Write ``resume.safetensors``, what ``--resume`` needs beside the weights. Raises OSError."""
        self._write_tensors(RESUME, tensors)

    def load_resume(self, only: Collection[str] = ()) -> Tensors:
        """Read what :meth:`save_resume` wrote, or ``only`` some of it. Raises UserError if it is missing or damaged."""
        from bilateral_rl.io import tensors as tensor_files  # torch, which listing runs does without

        path = self.path / RESUME
        try:
            return tensor_files.load(path, _LARGEST_RESUME, within=self.path, only=only)
        except FileNotFoundError:
            raise UserError(f"{path} does not exist, and without it the training cannot go on.") from None

    def write_json(self, name: str, values: Any) -> None:
        """Write ``values`` into the JSON file ``name``, whole or not at all. Raises OSError."""
        self.write_text(name, json.dumps(values, indent=2) + "\n")

    def read_json(self, name: str, default: Any = None) -> Any:
        """Read the JSON file ``name``; ``default`` stands for a missing one. Raises UserError if it is damaged."""
        path = self.path / name
        try:
            return json.loads(files.read(path, _LARGEST_JSON, within=self.path))
        except FileNotFoundError:
            return default
        except (ValueError, RecursionError) as error:
            raise UserError(f"{path} is damaged: {error}.") from None

    def write_text(self, name: str, text: str) -> None:
        """Write the text file ``name``, whole or not at all. Raises OSError."""
        with replacing(self.path / name) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="\n")

    def _write_tensors(self, name: str, tensors: Tensors) -> None:
        from bilateral_rl.io import tensors as tensor_files  # torch, which listing runs does without

        with replacing(self.path / name) as temporary:
            tensor_files.save(tensors, temporary)


def find_runs(out: Path) -> list[RunFolder]:
    """List the runs below ``out``, oldest first within each task and model."""
    # Not glob("*/*/config.yaml"): versions of Python differ in whether that finds a link that leads nowhere.
    configs = [path for folder in out.glob("*/*") if os.path.lexists(path := folder / "config.yaml")]
    return [RunFolder(path.parent) for path in sorted(configs, key=_natural)]


def _next_free(parent: Path, stem: str) -> Path:
    taken = [path.name.removeprefix(f"{stem}-") for path in parent.glob(f"{stem}-*")]
    number = max((int(n) for n in taken if n.isdecimal()), default=0) + 1
    while True:
        path = parent / f"{stem}-{number}"
        try:
            path.mkdir()
        except FileExistsError:  # another training took it just now
            number += 1
        else:
            return path


def _makes_sense(name: str, value: Any) -> bool:
    """Whether ``status.json`` can hold this value; names that others have added may have any."""
    if name in _STATUS_TYPES and type(value) is not _STATUS_TYPES[name]:
        return False
    return _STATUS_TYPES.get(name) is not int or 0 <= value <= _LARGEST_COUNT


def _natural(path: Path) -> tuple[str, str, int]:
    """Sort cc_s-ppo-2 before cc_s-ppo-10."""
    stem, _, number = path.parent.name.rpartition("-")
    return path.parent.parent.name, stem, int(number) if number.isdecimal() else 0
