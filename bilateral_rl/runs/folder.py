"""The folder of one training run: what is in it, written whole or not at all, read without executing anything."""

from __future__ import annotations

import contextlib
import importlib.metadata
import json
import os
import platform
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.io import files, locks
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import replacing
from bilateral_rl.io.yaml_files import read_settings

if TYPE_CHECKING:
    from bilateral_rl.io.tensors import Tensors

FINAL, BEST = "final", "best"
"""Names of weights."""
RUNNING, FINISHED, INTERRUPTED, FAILED, IMPORTED = "running", "finished", "interrupted", "failed", "imported"
"""States of a run."""
LARGEST_JSON, LARGEST_WEIGHTS, LARGEST_RESUME = 2**20, 2**30, 2**32
"""Bytes: the most that a configuration within bounds comes to."""
MOST_STEPS = 2**63
"""Of any count in ``status.json``."""

_PACKAGES = ("gymnasium", "numpy", "safetensors", "stable-baselines3", "torch", "warp-lang")


@dataclass(frozen=True)
class RunFolder:
    """``<out>/<task>/<model>-<algo>-<n>/``.

    It may be somebody else's. Whatever is read here is data and nothing else, of a size that it can have, and lies in
    the folder.
    """

    path: Path

    @classmethod
    def create(cls, out: Path, config: TrainConfig) -> RunFolder:
        """Make the next free folder and write the configuration and versions. Raises UserError if it cannot."""
        parent = out / config.task
        try:
            parent.mkdir(parents=True, exist_ok=True)
            folder = cls(_next_free(parent, f"{config.model}-{config.algo}"))
            with _removed_if_it_fails(folder.path):
                (folder.path / "weights").mkdir()
                folder.write_config(config)
                folder.write_json("versions.json", versions())
        except OSError as error:
            raise UserError(f"Cannot write a run under {out}: {error.strerror}. Choose another --out.") from None
        return folder

    @classmethod
    def open(cls, path: Path) -> RunFolder:
        """An existing run. Raises UserError if it is missing or is no run."""
        try:
            is_folder, is_zip = path.is_dir(), path.suffix.lower() == ".zip" and path.is_file()
            is_run = (path / "config.yaml").is_file()
        except OSError as error:
            raise UserError(f"There is no run {path}: {error.strerror}.") from None
        if is_zip:
            raise UserError(f"{path} is no run but a model; make one of it with `bilateral-rl import`.")
        if not is_folder:
            raise UserError(f"There is no run {path}; `bilateral-rl list` shows those there are.")
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
            files.remove_left_over(self.path)
            yield

    def write_config(self, config: TrainConfig) -> None:
        """Write ``config.yaml``."""
        self.write_text("config.yaml", yaml.safe_dump(config.to_values(), sort_keys=False))

    def config(self) -> TrainConfig:
        """The resolved configuration. Raises UserError if it is damaged."""
        values = read_settings(self.path / "config.yaml", within=self.path)
        try:
            return resolve(None, None, [values])
        except UserError as error:
            raise UserError(f"{self.path / 'config.yaml'} describes no training: {error}") from None

    def status(self) -> dict[str, Any]:
        """``status.json``: state, weights and how far it came; or an empty dictionary. Raises UserError if damaged."""
        status = self.read_json("status.json", default={})
        types = {"state": str, "timesteps": int, "epochs": int, "updates": int, "weights": str, "seeds": list}
        if (
            not isinstance(status, dict)
            or any(type(status.get(name, kind())) is not kind for name, kind in types.items())
            or any(not 0 <= status.get(name, 0) < MOST_STEPS for name, kind in types.items() if kind is int)
        ):
            raise UserError(f"{self.path / 'status.json'} is damaged: it does not say how far the training came.")
        return status

    def save_weights(self, name: str, tensors: Tensors) -> None:
        """Write ``weights/<name>.safetensors``."""
        self._write_tensors(f"weights/{name}.safetensors", tensors)

    def load_weights(self, name: str) -> Tensors:
        """Read ``weights/<name>.safetensors``. Raises UserError if it is missing, damaged or not finite."""
        from bilateral_rl.io import tensors as tensor_files  # torch, which listing runs does without

        names = self.weight_names()
        path = self.path / "weights" / f"{name}.safetensors"
        try:
            if name not in names:  # nor are names that lead elsewhere
                raise FileNotFoundError
            tensors = tensor_files.load(path, LARGEST_WEIGHTS, within=self.path)
        except FileNotFoundError:
            raise UserError(f"{path} does not exist; the run's weights are: {', '.join(names) or 'none'}.") from None
        broken = [key for key, tensor in tensors.items() if tensor.is_floating_point() and not tensor.isfinite().all()]
        if broken:
            raise UserError(f"The weights {name} of {self.path} are not finite numbers in {', '.join(broken)}.")
        return tensors

    def weights_hash(self, name: str) -> str:
        """Say in 16 characters which weights these are: results that carry another hash are of other weights.

        It is that of the tensors' names, types, shapes and values, however the file arranges them.

        Raises:
            UserError: the weights are missing, damaged or not finite.
        """
        from bilateral_rl.io import tensors as tensor_files  # torch, which listing runs does without

        return tensor_files.content_hash(self.load_weights(name))

    def weight_names(self) -> list[str]:
        """List the names that :meth:`load_weights` takes."""
        return sorted(path.stem for path in (self.path / "weights").glob("*.safetensors"))

    def save_resume(self, tensors: Tensors) -> None:
        """Write what ``--resume`` needs beside the weights."""
        self._write_tensors("resume.safetensors", tensors)

    def load_resume(self) -> Tensors:
        """What :meth:`save_resume` wrote. Raises UserError if it is missing or damaged."""
        from bilateral_rl.io import tensors as tensor_files  # torch, which listing runs does without

        path = self.path / "resume.safetensors"
        try:
            return tensor_files.load(path, LARGEST_RESUME, within=self.path)
        except FileNotFoundError:
            raise UserError(f"{path} does not exist, and without it the training cannot go on.") from None

    def write_json(self, name: str, values: Any) -> None:
        """Write ``name`` as JSON."""
        self.write_text(name, json.dumps(values, indent=2) + "\n")

    def read_json(self, name: str, default: Any = None) -> Any:
        """``name`` as JSON, or ``default`` if it is missing. Raises UserError if it is damaged."""
        path = self.path / name
        try:
            return json.loads(files.read(path, LARGEST_JSON, within=self.path))
        except FileNotFoundError:
            return default
        except (ValueError, RecursionError) as error:
            raise UserError(f"{path} is damaged: {error}.") from None

    def write_text(self, name: str, text: str) -> None:
        """Write ``name`` whole or not at all."""
        with replacing(self.path / name) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="\n")

    def _write_tensors(self, name: str, tensors: Tensors) -> None:
        from bilateral_rl.io import tensors as tensor_files  # torch, which listing runs does without

        with replacing(self.path / name) as temporary:
            tensor_files.save(tensors, temporary)


def find_runs(out: Path) -> list[RunFolder]:
    """Every run below ``out``, oldest first within each task and model."""
    return [RunFolder(path.parent) for path in sorted(out.glob("*/*/config.yaml"), key=_natural)]


def versions() -> dict[str, Any]:
    """Versions of what computes, the git commit if the code is in a checkout, and the machine."""
    import torch

    from bilateral_rl import __version__

    packages = {name: importlib.metadata.version(name) for name in _PACKAGES}

    return {
        "bilateral-rl": __version__,
        "commit": _git_commit(),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} CPUs",
        "torch_device": torch.cuda.get_device_name() if torch.cuda.is_available() else "cpu",
        **packages,
    }


@contextlib.contextmanager
def _removed_if_it_fails(folder: Path) -> Iterator[None]:
    try:
        yield
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _git_commit() -> str | None:
    here = Path(__file__).resolve().parent
    if not (here.parent / "pyproject.toml").is_file():
        return None  # installed: a repository around it would be somebody else's
    command = ["git", "-C", str(here), "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return None


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


def _natural(path: Path) -> tuple[str, str, int]:
    stem, _, number = path.parent.name.rpartition("-")
    return path.parent.parent.name, stem, int(number) if number.isdecimal() else 0
