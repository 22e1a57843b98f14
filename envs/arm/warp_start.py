"""Warp starts quietly, on machines without a GPU too."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
import sys
from collections.abc import Iterator
from typing import Any

import torch
import warp as wp

from bilateral_rl.envs.refusals import shown

_BLOCK = 32
"""Threads of a block on CUDA: a warp, so that a few long threads are spread over many processors."""


@functools.cache
def start_warp() -> None:
    """Initialize Warp once, without its banner and its warning that there is no CUDA driver."""
    wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)
    with contextlib.nullcontext() if _has_cuda_driver() else _muted_stderr():
        wp.init()


def launch_on(device: str | torch.device) -> dict[str, Any]:
    """Return ``wp.launch``'s arguments for torch tensors on ``device``: on CUDA, torch's stream and small blocks."""
    if torch.device(device).type == "cuda":
        return {"stream": wp.stream_from_torch(torch.cuda.current_stream(device)), "block_dim": _BLOCK}
    return {"device": str(device)}


def known_device(device: object) -> str:
    """Return Warp's name of a device, given as a name or as torch's device.

    Raises:
        ValueError: neither "cpu" nor a CUDA device that there is.
    """
    start_warp()
    try:
        chosen = torch.device(device)  # type: ignore[call-overload]
        if chosen.type != "cpu" and not wp.is_cuda_available():  # Warp would write about it
            raise ValueError(chosen)
        name = str(wp.get_device("cpu" if chosen.type == "cpu" else str(chosen)))
    except (RuntimeError, TypeError, ValueError):
        raise ValueError(f"device must be 'cpu' or a CUDA device of this machine, got {shown(device)}.") from None
    return name


def _has_cuda_driver() -> bool:
    """Return whether the CUDA driver's library can be loaded."""
    try:
        ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1")
    except OSError:
        return False
    return True


@contextlib.contextmanager
def _muted_stderr() -> Iterator[None]:
    """Return a context in which nothing is written to file descriptor 2.

    Native code reports the missing driver, past Python's streams and past Warp's log level.
    """
    sys.stderr.flush()
    saved, sink = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(sink, 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(sink)
