"""The CPUs of this machine."""

from __future__ import annotations

import os


def usable_cpus() -> int:
    """Count the CPUs that this process may use: where the system cannot say (macOS, Windows), all there are."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
