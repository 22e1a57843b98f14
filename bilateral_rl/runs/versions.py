"""What made a run: versions of packages, the commit of the code, and the machine."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import subprocess
from pathlib import Path
from typing import Any

_PACKAGES = ("gymnasium", "numpy", "safetensors", "stable-baselines3", "torch", "warp-lang")
_CHECKOUT = Path(__file__).resolve().parents[2]


def versions() -> dict[str, Any]:
    """Collect the versions of what computes, the git commit if the code is in a checkout, and the machine."""
    import torch  # a second, which listing runs does without

    from bilateral_rl import __version__

    return {
        "bilateral-rl": __version__,
        "commit": _git_commit(),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} CPUs",
        "torch_device": torch.cuda.get_device_name() if torch.cuda.is_available() else "cpu",
        **{name: importlib.metadata.version(name) for name in _PACKAGES},
    }


def _git_commit() -> str | None:
    if not (_CHECKOUT / "pyproject.toml").is_file():
        return None  # installed: a repository around it would be somebody else's
    command = ["git", "-C", str(_CHECKOUT), "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    try:
        ended = subprocess.run(command, capture_output=True, encoding="utf-8", check=True, timeout=10)
    except (OSError, subprocess.SubprocessError):
        return None
    return ended.stdout.strip()
