"""Tensors in safetensors files, which hold numbers and names and nothing that could be executed."""

from __future__ import annotations

import hashlib
from collections.abc import Collection
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import load_file
from safetensors.torch import save as to_bytes
from torch import Tensor

from bilateral_rl.io import files
from bilateral_rl.io.errors import UserError

Tensors = dict[str, Tensor]

DTYPES = (torch.float32, torch.float64, torch.int32, torch.int64, torch.uint8, torch.bool)
"""The types that runs hold; torch knows more than it can compute with."""
_MOST_DIMENSIONS = 8


def save(tensors: Tensors, path: Path) -> None:
    """Write ``tensors``, on whatever device they are. Raises OSError if the file cannot be written."""
    # The library's ``save_file`` leaves a second temporary file where it is killed, and lets nobody else read the file.
    path.write_bytes(to_bytes({name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}))


def load(path: Path, most: int, within: Path, only: Collection[str] = ()) -> Tensors:
    """Read the tensors, by name, that a file of a run folder holds.

    Args:
        path: the file.
        most: the largest size accepted, in bytes.
        within: the run folder.
        only: the names of those to read, of which the file may lack some; empty for all.

    Raises:
        FileNotFoundError: the file does not exist.
        UserError: it is damaged, or as for :func:`bilateral_rl.io.files.find`.
    """
    real = files.find(path, most, within)
    try:
        tensors = _some_of(real, only) if only else load_file(real)  # refuses a header that claims more than 100 MB
        for name, tensor in tensors.items():
            if tensor.dtype not in DTYPES or tensor.ndim > _MOST_DIMENSIONS:
                raise ValueError(f"its {name} is of type {tensor.dtype} and of {tensor.ndim} dimensions")
    except (SafetensorError, OSError, ValueError, RuntimeError, TypeError, LookupError) as error:
        raise UserError(f"{path} is damaged: {error}.") from None
    return tensors


def _some_of(path: Path, names: Collection[str]) -> Tensors:
    with safe_open(path, framework="pt") as file:
        return {name: file.get_tensor(name) for name in file.keys() if name in names}  # noqa: SIM118 - no dictionary


def content_hash(tensors: Tensors) -> str:
    """Compute a hash of names, types, shapes and values (SHA-256, its first 16 digits), whatever their order."""
    digest = hashlib.sha256()
    for name, tensor in sorted(tensors.items()):
        digest.update(f"{name!r} {tensor.dtype} {list(tensor.shape)}\n".encode())
        digest.update(tensor.detach().cpu().contiguous().numpy().tobytes())
    return digest.hexdigest()[:16]
