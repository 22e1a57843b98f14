"""The folder of one training run: what is in it, written whole or not at all, read without executing anything."""

from __future__ import annotations

import contextlib
import importlib.metadata
import json
import os
import platform
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
import yaml
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor

from bilateral_rl import settings
from bilateral_rl.config import TrainConfig
from bilateral_rl.errors import UserError
from bilateral_rl.resolve import resolve

FINAL, BEST = "final", "best"
Tensors = dict[str, Tensor]

_PACKAGES = ("gymnasium", "numpy", "safetensors", "stable-baselines3", "torch", "warp-lang")


@dataclass(frozen=True)
class RunFolder:
    """``<out>/<task>/<model>-<algo>-<n>/``."""

    path: Path

    @classmethod
    def create(cls, out: Path, config: TrainConfig) -> RunFolder:
        """Make the next free folder and write the configuration and versions. Raises UserError if it cannot."""
        parent = out / config.task
        try:
            parent.mkdir(parents=True, exist_ok=True)
            folder = cls(_next_free(parent, f"{config.model}-{config.algo}"))
            (folder.path / "weights").mkdir()
        except OSError as error:
            raise UserError(f"Cannot write a run under {out}: {error.strerror}. Choose another --out.") from None
        folder.write_config(config)
        folder.write_json("versions.json", versions())
        return folder

    @classmethod
    def open(cls, path: Path) -> RunFolder:
        """An existing run. Raises UserError if it is missing or is no run."""
        if not path.is_dir():
            raise UserError(f"There is no run {path}; `bilateral-rl list` shows those there are.")
        if not (path / "config.yaml").is_file():
            raise UserError(f"{path} is not a run: it has no config.yaml. `bilateral-rl list` shows those there are.")
        return cls(path)

    def write_config(self, config: TrainConfig) -> None:
        """Write ``config.yaml``."""
        self.write_text("config.yaml", yaml.safe_dump(config.to_values(), sort_keys=False))

    def config(self) -> TrainConfig:
        """The resolved configuration. Raises UserError if it is damaged."""
        values = settings.load_file(self.path / "config.yaml")
        return resolve(None, None, [values])

    def status(self) -> dict[str, Any]:
        """``status.json``: state, weights and how far it came; or an empty dictionary. Raises UserError if damaged."""
        status = self.read_json("status.json", default={})
        types = {"state": str, "timesteps": int, "epochs": int, "updates": int, "weights": str, "seeds": list}
        if not isinstance(status, dict) or any(not isinstance(status.get(k, t()), t) for k, t in types.items()):
            raise UserError(f"{self.path / 'status.json'} is damaged: it does not say how far the training came.")
        return status

    def save_weights(self, name: str, tensors: Tensors) -> None:
        """Write ``weights/<name>.safetensors``."""
        self._write_tensors(f"weights/{name}.safetensors", tensors)

    def load_weights(self, name: str) -> Tensors:
        """Read ``weights/<name>.safetensors``. Raises UserError if it is missing, damaged or not finite."""
        tensors = self._read_tensors(f"weights/{name}.safetensors")
        broken = [key for key, tensor in tensors.items() if tensor.is_floating_point() and not tensor.isfinite().all()]
        if broken:
            raise UserError(f"The weights {name} of {self.path} are not finite numbers in {', '.join(broken)}.")
        return tensors

    def weight_names(self) -> list[str]:
        """Names that :meth:`load_weights` takes."""
        return sorted(path.stem for path in (self.path / "weights").glob("*.safetensors"))

    def save_resume(self, tensors: Tensors) -> None:
        """Write what ``--resume`` needs beside the weights."""
        self._write_tensors("resume.safetensors", tensors)

    def load_resume(self) -> Tensors:
        """What :meth:`save_resume` wrote. Raises UserError if it is missing or damaged."""
        return self._read_tensors("resume.safetensors")

    def write_json(self, name: str, values: Any) -> None:
        """Write ``name`` as JSON."""
        self.write_text(name, json.dumps(values, indent=2) + "\n")

    def read_json(self, name: str, default: Any = None) -> Any:
        """``name`` as JSON, or ``default`` if it is missing. Raises UserError if it is damaged."""
        try:
            return json.loads((self.path / name).read_text(encoding="utf-8"))
        except FileNotFoundError:
            return default
        except (OSError, ValueError) as error:
            raise UserError(f"{self.path / name} is damaged: {error}.") from None

    def write_text(self, name: str, text: str) -> None:
        """Write ``name`` whole or not at all."""
        with replacing(self.path / name) as temporary:
            temporary.write_text(text, encoding="utf-8")

    def _write_tensors(self, name: str, tensors: Tensors) -> None:
        with replacing(self.path / name) as temporary:
            save_file({key: tensor.detach().cpu().contiguous() for key, tensor in tensors.items()}, temporary)

    def _read_tensors(self, name: str) -> Tensors:
        path = self.path / name
        if not path.is_file():
            names = ", ".join(self.weight_names()) or "none"
            raise UserError(f"{path} does not exist; the run's weights are: {names}.")
        try:
            return load_file(path)
        except (SafetensorError, OSError, ValueError) as error:
            raise UserError(f"{path} is damaged: {error}.") from None


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path beside ``path`` that takes its place at the end, or vanishes if anything fails."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o644)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def find_runs(out: Path) -> list[RunFolder]:
    """Every run below ``out``, oldest first within each task and model."""
    return [RunFolder(path.parent) for path in sorted(out.glob("*/*/config.yaml"), key=_natural)]


def versions() -> dict[str, Any]:
    """Versions of what computes, the git commit if the code is in a checkout, and the machine."""
    packages = {name: importlib.metadata.version(name) for name in _PACKAGES}
    from bilateral_rl.version import __version__

    return {
        "bilateral-rl": __version__,
        "commit": _git_commit(),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} CPUs",
        "torch_device": torch.cuda.get_device_name() if torch.cuda.is_available() else "cpu",
        **packages,
    }


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
