"""The arm: two joints, six muscles, physics written once as Warp kernels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bilateral_rl.envs.arm.parameters import MUSCLE_NAMES, ArmParameters

if TYPE_CHECKING:
    from bilateral_rl.envs.arm.arm import Arm, ArmState

__all__ = ["MUSCLE_NAMES", "Arm", "ArmParameters", "ArmState"]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name not in ("Arm", "ArmState"):
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from bilateral_rl.envs.arm import arm  # Warp and torch, which the parameters do without

        return getattr(arm, name)
