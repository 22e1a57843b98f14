"""Tensors in safetensors files, which hold numbers and names and nothing that could be executed."""

from __future__ import annotations

import hashlib
from pathlib import Path

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file
from safetensors.torch import save as to_bytes
from torch import Tensor

from bilateral_rl.io import files
from bilateral_rl.io.errors import UserError

Tensors = dict[str, Tensor]

LARGEST_HEADER = 2**20
"""Bytes: names and shapes of ten thousand tensors."""
DTYPES = (torch.float32, torch.float64, torch.int32, torch.int64, torch.uint8, torch.bool)
MOST_DIMENSIONS = 8
"""What runs hold; torch knows more kinds than it can compute with."""


def save(tensors: Tensors, path: Path) -> None:
    """Write ``tensors`` from whatever device. Raises OSError if it cannot be written."""
    # Its own ``save_file`` leaves a second temporary file where it is killed, and lets nobody else read the result.
    path.write_bytes(to_bytes({name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}))


def load(path: Path, most: int, within: Path) -> Tensors:
    """The tensors that a file of a run folder holds.

    Args:
        path: the file.
        most: bytes that it may have.
        within: the run folder.

    Raises:
        FileNotFoundError: it is not there.
        UserError: it is damaged, or as for :func:`bilateral_rl.io.files.find`.
    """
    real = files.find(path, most, within)
    try:
        with real.open("rb") as file:
            header = int.from_bytes(file.read(8), "little")
        if header > LARGEST_HEADER:
            raise ValueError(f"its header claims {header:,} bytes")
        tensors = load_file(real)
        for name, tensor in tensors.items():
            if tensor.dtype not in DTYPES or tensor.ndim > MOST_DIMENSIONS:
                raise ValueError(f"its {name} is of type {tensor.dtype} and of {tensor.ndim} dimensions")
    except (SafetensorError, OSError, ValueError, RuntimeError, TypeError, LookupError) as error:
        raise UserError(f"{path} is damaged: {error}.") from None
    return tensors


def content_hash(tensors: Tensors) -> str:
    """Compute a hash of names, types, shapes and values (SHA-256, its first 16 digits), whatever their order."""
    digest = hashlib.sha256()
    for name, tensor in sorted(tensors.items()):
        digest.update(f"{name!r} {tensor.dtype} {list(tensor.shape)}\n".encode())
        digest.update(tensor.detach().cpu().contiguous().numpy().tobytes())
    return digest.hexdigest()[:16]
