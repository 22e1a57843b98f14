"""One thread an arm: the kernels that batch the physics for the differentiable :class:`~bilateral_rl.envs.arm.Arm`."""

import functools
from typing import Any, NamedTuple

import warp as wp

from bilateral_rl.envs.arm.adjoint import arm_adjoint
from bilateral_rl.envs.arm.muscles import activate, muscle_torque, muscles_at, resting_muscles
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import ACTIVATION, FORCE, arm_types, hand, next_joint


class ArmKernels(NamedTuple):
    """The kernels of ``n`` arms, one thread each."""

    rest: wp.Kernel
    """Muscles at minimal activation, and the hand, from a joint state."""
    step: wp.Kernel
    """One Euler step: state in, state out."""
    step_adjoint: wp.Kernel
    """Gradients with respect to what a step took, from those with respect to what it gave."""


@functools.cache
def arm_kernels(real: Any) -> ArmKernels:
    """Return the kernels in precision ``real`` (``wp.float32`` or ``wp.float64``)."""
    _, vec2, vec4, vec6, rows, Parameters = arm_types(real)
    adjoint = arm_adjoint(real)
    linearize, pull_back = adjoint.linearize, adjoint.pull_back

    @wp.kernel(module="unique", enable_backward=False)
    def rest(
        p: Parameters,
        joint: wp.array(dtype=vec4),
        muscle: wp.array(dtype=rows),
        cartesian: wp.array(dtype=vec4),
    ) -> None:
        arm = wp.tid()
        muscle[arm] = resting_muscles(p, joint[arm])
        cartesian[arm] = hand(p, joint[arm])

    @wp.kernel(module="unique", enable_backward=False)
    def step(
        p: Parameters,
        joint: wp.array(dtype=vec4),
        muscle: wp.array(dtype=rows),
        excitation: wp.array(dtype=vec6),
        load: wp.array(dtype=vec2),
        joint_next: wp.array(dtype=vec4),
        muscle_next: wp.array(dtype=rows),
        cartesian_next: wp.array(dtype=vec4),
    ) -> None:
        arm = wp.tid()
        before = joint[arm]
        state = muscle[arm]
        after = next_joint(p, before, muscle_torque(p, before, state[FORCE]), load[arm])
        joint_next[arm] = after
        # The muscles' geometry is that of the joints before the step, the paper's order.
        muscle_next[arm] = muscles_at(p, before, activate(p, state[ACTIVATION], excitation[arm]))
        cartesian_next[arm] = hand(p, after)

    @wp.kernel(module="unique", enable_backward=False)
    def step_adjoint(
        p: Parameters,
        joint: wp.array(dtype=vec4),
        muscle: wp.array(dtype=rows),
        excitation: wp.array(dtype=vec6),
        load: wp.array(dtype=vec2),
        muscle_next: wp.array(dtype=rows),
        d_joint_next: wp.array(dtype=vec4),
        d_muscle_next: wp.array(dtype=rows),
        d_cartesian_next: wp.array(dtype=vec4),
        d_joint: wp.array(dtype=vec4),
        d_muscle: wp.array(dtype=rows),
        d_excitation: wp.array(dtype=vec6),
        d_load: wp.array(dtype=vec2),
    ) -> None:
        arm = wp.tid()
        before = joint[arm]
        state = muscle[arm]
        after = muscle_next[arm]
        slopes = linearize(p, before, state[ACTIVATION], excitation[arm], after)
        gradients = pull_back(
            p, slopes, before, state[FORCE], load[arm], after,
            d_joint_next[arm], d_muscle_next[arm], d_cartesian_next[arm],
        )  # fmt: skip
        # A step takes activation and force of the muscle state; the other five rows are made anew from the joints.
        d_state = rows()
        for m in range(N_MUSCLES):
            d_state[ACTIVATION, m] = gradients.activation[m]
            d_state[FORCE, m] = gradients.force[m]
        d_joint[arm] = gradients.joint
        d_muscle[arm] = d_state
        d_excitation[arm] = gradients.excitation
        d_load[arm] = gradients.load

    return ArmKernels(rest, step, step_adjoint)
