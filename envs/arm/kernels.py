"""One thread an arm: the kernels that batch the physics for the differentiable :class:`~bilateral_rl.envs.arm.Arm`."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from bilateral_rl.envs.arm.adjoint import arm_adjoint
from bilateral_rl.envs.arm.muscles import muscle_functions
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import ACTIVATION, FORCE, arm_physics


@functools.cache
def arm_kernels(real: Any) -> SimpleNamespace:
    """The kernels ``rest`` (minimal activation), ``step`` (state in, state out) and ``step_adjoint``, in ``real``."""
    physics, muscles = arm_physics(real), muscle_functions(real)
    Parameters, vec2, vec4, vec6, rows = physics.Parameters, physics.vec2, physics.vec4, physics.vec6, muscles.rows
    hand, next_joint = physics.hand, physics.next_joint
    muscle_torque, muscles_at, activate = muscles.muscle_torque, muscles.muscles_at, muscles.activate
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
        activation = vec6()
        for m in range(N_MUSCLES):
            activation[m] = p.min_activation
        muscle[arm] = muscles_at(p, joint[arm], activation)
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
        here = joint[arm]
        state = muscle[arm]
        there = next_joint(p, here, muscle_torque(p, here, state[FORCE]), load[arm])
        joint_next[arm] = there
        muscle_next[arm] = muscles_at(p, here, activate(p, state[ACTIVATION], excitation[arm]))
        cartesian_next[arm] = hand(p, there)

    @wp.kernel(module="unique", enable_backward=False)
    def step_adjoint(
        p: Parameters,
        joint: wp.array(dtype=vec4),
        muscle: wp.array(dtype=rows),
        excitation: wp.array(dtype=vec6),
        load: wp.array(dtype=vec2),
        muscle_next: wp.array(dtype=rows),
        joint_gradient: wp.array(dtype=vec4),
        muscle_gradient: wp.array(dtype=rows),
        cartesian_gradient: wp.array(dtype=vec4),
        of_joint: wp.array(dtype=vec4),
        of_muscle: wp.array(dtype=rows),
        of_excitation: wp.array(dtype=vec6),
        of_load: wp.array(dtype=vec2),
    ) -> None:
        arm = wp.tid()
        here = joint[arm]
        state = muscle[arm]
        there = muscle_next[arm]
        slopes = linearize(p, here, state[ACTIVATION], excitation[arm], there)
        back = pull_back(
            p, slopes, here, state[FORCE], load[arm], there,
            joint_gradient[arm], muscle_gradient[arm], cartesian_gradient[arm],
        )  # fmt: skip
        of_state = rows()
        for m in range(N_MUSCLES):
            of_state[ACTIVATION, m] = back.activation[m]
            of_state[FORCE, m] = back.force[m]
        of_joint[arm] = back.joint
        of_muscle[arm] = of_state
        of_excitation[arm] = back.excitation
        of_load[arm] = back.load

    return SimpleNamespace(rest=rest, step=step, step_adjoint=step_adjoint, physics=physics, muscles=muscles)
