"""The arm: two joints, six muscles, physics written once as Warp kernels."""

from bilateral_rl.envs.arm.arm import Arm, ArmState
from bilateral_rl.envs.arm.parameters import MUSCLE_NAMES, ArmParameters

__all__ = ["MUSCLE_NAMES", "Arm", "ArmParameters", "ArmState"]
