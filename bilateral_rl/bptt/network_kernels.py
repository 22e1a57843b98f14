"""The networks of ``policies/networks.py`` as Warp functions for one sample, forward; ``network_adjoint.py`` goes back.

The torch modules stay the definition, and tests compare both, in every architecture, size and lesion. Why then twice:
a thread runs its trial's network inside its loop over the steps, where torch would launch thirty operations a step on
matrices too small to fill it. An update of ten seeds of ``cc_s`` written in stacked torch (``baddbmm``, around the same
``Arm.step``, with both streams' gradients) took 214 ms, and 75 ms by these kernels, on one thread of a busy machine: a
factor of 2.8, or the whole study in one hour instead of three.

These are made by functions of precision and shape, as Warp's structs have no generics and its vectors have lengths that
must be known when they are compiled; with a shape known, a loop over its layers, sides and units is unrolled too.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from bilateral_rl.policies.motor_network import MotorNetwork

INPUT_DOMINANT, INPUT_NON_DOMINANT, OUTPUT_DOMINANT, OUTPUT_NON_DOMINANT, CALLOSUM, N_GATES = range(6)
"""Gates of a network, each 1 where open and 0 where a lesion has closed it."""


class NetworkShape(NamedTuple):
    """What kernels must know of a network when they are compiled."""

    n_inputs: int
    n_outputs: int
    width: int
    """Units of a hidden layer of one side."""
    layers: int
    sides: int
    callosal: bool
    arms: int = 1
    """Output layers: 2 where both sides command two arms; then each side sees the view of its contralateral arm."""

    @classmethod
    def of(cls, network: MotorNetwork) -> "NetworkShape":
        """Return the shape of ``network``."""
        sides = 1 if network.architecture == "unilateral" else 2
        return cls(
            n_inputs=network.n_inputs,
            n_outputs=network.n_outputs,
            width=network.units // sides,
            layers=network.layers,
            sides=sides,
            callosal=network.architecture == "callosal",
            arms=network.n_arms if sides == 2 else 1,
        )

    @property
    def n_seen(self) -> int:
        """Number of inputs of a side."""
        return self.n_inputs // self.arms

    @property
    def n_muscles(self) -> int:
        """Number of outputs of an output layer."""
        return self.n_outputs // self.arms

    def seen_by(self, side: int) -> slice:
        """Return which of the inputs a side sees."""
        first = side * self.n_seen if self.arms > 1 else 0
        return slice(first, first + self.n_seen)


class NetworkTypes(NamedTuple):
    """Warp's types for networks of one shape in one precision."""

    vec_in: Any
    """(n_inputs,): an observation."""
    vec_in_one: Any
    """(n_inputs + 1,): an observation followed by a one."""
    vec_out: Any
    """(n_outputs,): an excitation, of every arm."""
    vec_arm: Any
    """(n_muscles,): what an output layer puts out."""
    vec_side: Any
    """(width,): activity of a layer of one side."""
    vec_side_one: Any
    """(width + 1,): such activity followed by a one."""
    both: Any
    """(sides, width): activity of a layer of every side."""
    Weights: Any
    """Struct, the parameters of a stack."""
    Activity: Any
    """Struct, what the forward pass remembers."""
    Deltas: Any
    """Struct, what the adjoint puts out."""


@functools.cache
def network_types(real: Any, shape: NetworkShape) -> NetworkTypes:
    """Return the types of networks of ``shape`` in precision ``real`` (``wp.float32`` or ``wp.float64``).

    Arrays are per network ``s`` of a stack of ``S``, and per sample ``k`` of ``n``, a step of a trial. A layer's last
    row of weights is its bias, and so what a layer receives ends in a one: the gradient of a layer's weights, bias
    included, is one product of matrices, what it received (n, width + 1) transposed times its deltas (n, width).
    """
    vec_in = wp.types.vector(shape.n_inputs, real)
    vec_in_one = wp.types.vector(shape.n_inputs + 1, real)
    vec_out = wp.types.vector(shape.n_outputs, real)
    vec_arm = wp.types.vector(shape.n_muscles, real)
    vec_side = wp.types.vector(shape.width, real)
    vec_side_one = wp.types.vector(shape.width + 1, real)
    both = wp.types.matrix((shape.sides, shape.width), real)

    @wp.struct
    class Weights:
        """Parameters of ``S`` stacked networks."""

        first: wp.array3d(dtype=vec_side)  # (S, sides, n_seen + 1)
        hidden: wp.array3d(dtype=vec_side)  # (S, (layers - 1) * sides, width + 1)
        combination: wp.array3d(dtype=real)  # (S, 2, arms), or (S, 0, arms) of one side
        output: wp.array3d(dtype=vec_arm)  # (S, arms, width + 1)
        gates: wp.array2d(dtype=real)  # (S, N_GATES)

    @wp.struct
    class Activity:
        """What the networks did on ``n`` samples."""

        observation: wp.array(dtype=vec_in_one)  # (n,)
        received: wp.array2d(dtype=vec_side_one)  # (n, (layers - 1) * sides), after the exchange over the callosum
        hidden: wp.array2d(dtype=vec_side)  # (n, layers * sides), before it
        combined: wp.array2d(dtype=vec_side_one)  # (n, arms)
        noise: wp.array2d(dtype=vec_side)  # (n, layers * sides), already scaled, part of ``hidden``; empty if none

    @wp.struct
    class Deltas:
        """Gradients of the streams' losses with respect to what each layer puts into its nonlinearity."""

        hidden: wp.array3d(dtype=vec_side)  # (n, streams, layers * sides)
        output: wp.array3d(dtype=vec_arm)  # (n, streams, arms)
        combination: wp.array4d(dtype=real)  # (streams, trials, 2, arms), by the weights, summed over steps
        activity: wp.array3d(dtype=vec_side)  # (streams, n, layers * sides) of a loss on hidden activity, or empty

    vectors = (vec_in, vec_in_one, vec_out, vec_arm, vec_side, vec_side_one)
    return NetworkTypes(*vectors, both, Weights, Activity, Deltas)


@functools.cache
def network_forward(real: Any, shape: NetworkShape, noisy: bool) -> Any:
    """Return the Warp function ``excite`` of networks of ``shape``, maybe with noisy units, in precision ``real``."""
    vec_in, vec_in_one, vec_out, _, vec_side, vec_side_one, both, Weights, Activity, _ = network_types(real, shape)
    n_inputs, _, width, layers, sides, callosal, arms = shape
    n_seen, n_muscles = shape.n_seen, shape.n_muscles
    apart = shape.seen_by(1).start  # from the first input of one side to the first of the other
    pooled = width // 2  # numbers that a side sends
    kept = width - pooled  # units of a side that receive nothing

    @wp.func
    def tanh(x: vec_side) -> vec_side:
        """Return the tanh by the exponential, which costs a quarter of the library's; within 2e-7 of it."""
        y = vec_side()
        for i in range(width):
            y[i] = real(1.0) - real(2.0) / (wp.exp(real(2.0) * x[i]) + real(1.0))
        return y

    @wp.func
    def followed_by_one(x: vec_side) -> vec_side_one:
        """Return ``x`` with a one behind it, which the bias is multiplied by."""
        y = vec_side_one()
        for i in range(width):
            y[i] = x[i]
        y[width] = real(1.0)
        return y

    @wp.func
    def exchange(h: both, open: real) -> both:
        """Return what both sides hold once each has received the other's pooled activity through the callosum.

        A side sends the larger of each two neighbors, leaving out a last odd one, and adds what it receives to its last
        units; both send what they held before. With five units a side, a b c d e and v w x y z, the first becomes
        a b c d+max(v,w) e+max(x,y), and the second v w x y+max(a,b) z+max(c,d). ``open`` is 0 where the callosum is
        cut, else 1.
        """
        received = both(h)
        for side in range(sides):
            for j in range(pooled):
                sent = wp.max(h[sides - 1 - side, 2 * j], h[sides - 1 - side, 2 * j + 1])
                received[side, kept + j] = h[side, kept + j] + open * sent
        return received

    @wp.func
    def excite(w: Weights, a: Activity, s: int, k: int, observation: vec_in) -> vec_out:
        """Return the excitation that network ``s`` commands on sample ``k``; fills row ``k`` of ``a``."""
        remembered = vec_in_one()
        for i in range(n_inputs):
            remembered[i] = observation[i]
        remembered[n_inputs] = real(1.0)
        a.observation[k] = remembered
        # First layer: a side sees what is its own; a closed input gate lets its bias through, and nothing else.
        h = both()
        for side in range(sides):
            drive_in = vec_side()
            for i in range(n_seen):
                drive_in += observation[side * apart + i] * w.first[s, side, i]
            active = tanh(w.gates[s, INPUT_DOMINANT + side] * drive_in + w.first[s, side, n_seen])
            if noisy:
                active = active + a.noise[k, side]
            h[side] = active
            a.hidden[k, side] = active
        # Every further layer: each side by itself, after an exchange over the callosum if there is one.
        for layer in range(1, layers):
            if callosal:
                h = exchange(h, w.gates[s, CALLOSUM])
            for side in range(sides):
                row = (layer - 1) * sides + side
                received = h[side]
                a.received[k, row] = followed_by_one(received)
                drive = w.hidden[s, row, width]
                for i in range(width):
                    drive += received[i] * w.hidden[s, row, i]
                active = tanh(drive)
                if noisy:
                    active = active + a.noise[k, layer * sides + side]
                h[side] = active
                a.hidden[k, layer * sides + side] = active
        # Output: the sides are added by their combination weights, so that both share an arm's output layer.
        excitation = vec_out()
        for arm in range(arms):
            combined = h[0]
            if sides == 2:
                combined = (
                    w.gates[s, OUTPUT_DOMINANT] * w.combination[s, 0, arm] * h[0]
                    + w.gates[s, OUTPUT_NON_DOMINANT] * w.combination[s, 1, arm] * h[sides - 1]
                )
            a.combined[k, arm] = followed_by_one(combined)
            drive_out = w.output[s, arm, width]
            for i in range(width):
                drive_out += combined[i] * w.output[s, arm, i]
            for i in range(n_muscles):
                excitation[arm * n_muscles + i] = real(1.0) / (real(1.0) + wp.exp(-drive_out[i]))
        return excitation

    return excite
