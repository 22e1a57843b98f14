"""The networks of ``policies/networks.py`` as Warp functions for one trial, forward and adjoint.

A thread runs its trial's network inside its loop over the steps, where torch would pay for thirty small operations a
step. The torch modules stay the definition: tests compare both, in every architecture, size and lesion.
"""

import functools
from types import SimpleNamespace
from typing import Any, NamedTuple

import warp as wp

from bilateral_rl.policies.networks import MotorNetwork

INPUT_DOMINANT, INPUT_NON_DOMINANT, OUTPUT_DOMINANT, OUTPUT_NON_DOMINANT, CALLOSUM, N_GATES = range(6)
"""What a lesion closes: gates are 1 where open, 0 where closed."""


class NetworkShape(NamedTuple):
    """What kernels must know of a network when they are compiled."""

    n_inputs: int
    n_outputs: int
    width: int
    """Units of a hidden layer of one side."""
    layers: int
    sides: int
    callosal: bool

    @classmethod
    def of(cls, network: MotorNetwork) -> "NetworkShape":
        """The shape of ``network``."""
        sides = 1 if network.architecture == "unilateral" else 2
        return cls(
            n_inputs=network.n_inputs,
            n_outputs=network.n_outputs,
            width=network.units // sides,
            layers=network.layers,
            sides=sides,
            callosal=network.architecture == "callosal",
        )


@functools.cache
def network_functions(real: Any, shape: NetworkShape) -> SimpleNamespace:
    """Warp structs and functions of the networks of ``shape`` in precision ``real``.

    ``excite`` computes a step's muscle excitation and remembers what ``excite_adjoint`` needs. Arrays are per network
    ``s`` of a stack, and per sample ``k``, a step of a trial. A layer's last row of weights is its bias, and so what a
    layer receives ends in a one: the gradient of a layer is one matrix product.
    """
    n_inputs, n_outputs, width, layers, sides, callosal = shape
    pooled = width // 2
    kept = width - pooled
    vec_in = wp.types.vector(n_inputs, real)
    vec_in_one = wp.types.vector(n_inputs + 1, real)
    vec_out = wp.types.vector(n_outputs, real)
    vec_side = wp.types.vector(width, real)
    vec_side_one = wp.types.vector(width + 1, real)
    both = wp.types.matrix((sides, width), real)

    @wp.struct
    class Weights:
        """Of ``S`` stacked networks."""

        first: wp.array3d(dtype=vec_side)  # (S, sides, n_inputs + 1)
        hidden: wp.array3d(dtype=vec_side)  # (S, (layers - 1) * sides, width + 1)
        combination: wp.array2d(dtype=real)  # (S, 2)
        output: wp.array2d(dtype=vec_out)  # (S, width + 1)
        gates: wp.array2d(dtype=real)  # (S, N_GATES)

    @wp.struct
    class Activity:
        """Of ``n`` samples."""

        observation: wp.array(dtype=vec_in_one)  # (n,)
        received: wp.array2d(dtype=vec_side_one)  # (n, (layers - 1) * sides), after the exchange over the callosum
        hidden: wp.array2d(dtype=vec_side)  # (n, layers * sides), before it
        combined: wp.array(dtype=vec_side_one)  # (n,)

    @wp.struct
    class Deltas:
        """Gradients of the streams' losses with respect to what each layer puts into its nonlinearity."""

        hidden: wp.array3d(dtype=vec_side)  # (n, streams, layers * sides)
        output: wp.array2d(dtype=vec_out)  # (n, streams)
        combination: wp.array3d(dtype=real)  # (streams, trials, 2), with respect to the weights, summed over steps
        activity: wp.array3d(dtype=vec_side)  # (streams, n, layers * sides) of a loss on hidden activity, or empty

    @wp.func
    def tanh(x: vec_side) -> vec_side:
        """By the exponential, which costs a quarter of the library's; within 2e-7 of it."""
        y = vec_side()
        for i in range(width):
            y[i] = real(1.0) - real(2.0) / (wp.exp(real(2.0) * x[i]) + real(1.0))
        return y

    @wp.func
    def followed_by_one(x: vec_side) -> vec_side_one:
        y = vec_side_one()
        for i in range(width):
            y[i] = x[i]
        y[width] = real(1.0)
        return y

    @wp.func
    def exchange(h: both, open: real) -> both:
        """What both sides hold once each has received the other's pooled activity."""
        received = both(h)
        for side in range(sides):
            for j in range(pooled):
                sent = wp.max(h[sides - 1 - side, 2 * j], h[sides - 1 - side, 2 * j + 1])
                received[side, kept + j] = h[side, kept + j] + open * sent
        return received

    @wp.func
    def exchange_adjoint(h: both, open: real, gradient: both) -> both:
        """The gradient with respect to ``h`` from that with respect to what was received."""
        back = both(gradient)
        for side in range(sides):
            other = sides - 1 - side
            for j in range(pooled):
                sent = 2 * j
                if h[other, 2 * j] < h[other, 2 * j + 1]:
                    sent = 2 * j + 1
                back[other, sent] = back[other, sent] + open * gradient[side, kept + j]
        return back

    @wp.func
    def excite(w: Weights, a: Activity, s: int, k: int, observation: vec_in) -> vec_out:
        """The excitation that network ``s`` commands on sample ``k``."""
        remembered = vec_in_one()
        for i in range(n_inputs):
            remembered[i] = observation[i]
        remembered[n_inputs] = real(1.0)
        a.observation[k] = remembered
        h = both()
        for side in range(sides):
            seen = vec_side()
            for i in range(n_inputs):
                seen += observation[i] * w.first[s, side, i]
            active = tanh(w.gates[s, INPUT_DOMINANT + side] * seen + w.first[s, side, n_inputs])
            h[side] = active
            a.hidden[k, side] = active
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
                h[side] = active
                a.hidden[k, layer * sides + side] = active
        combined = h[0]
        if sides == 2:
            combined = (
                w.gates[s, OUTPUT_DOMINANT] * w.combination[s, 0] * h[0]
                + w.gates[s, OUTPUT_NON_DOMINANT] * w.combination[s, 1] * h[sides - 1]
            )
        a.combined[k] = followed_by_one(combined)
        drive_out = w.output[s, width]
        for i in range(width):
            drive_out += combined[i] * w.output[s, i]
        excitation = vec_out()
        for i in range(n_outputs):
            excitation[i] = real(1.0) / (real(1.0) + wp.exp(-drive_out[i]))
        return excitation

    @wp.func
    def excite_adjoint(
        w: Weights,
        a: Activity,
        d: Deltas,
        s: int,
        k: int,
        stream: int,
        trial: int,
        excitation: vec_out,
        gradient: vec_out,
    ) -> vec_in:
        """The gradient with respect to the observation from that with respect to the excitation; fills ``d``."""
        delta_out = vec_out()
        for i in range(n_outputs):
            delta_out[i] = gradient[i] * excitation[i] * (real(1.0) - excitation[i])
        d.output[k, stream] = delta_out
        of_combined = vec_side()
        for i in range(width):
            of_combined[i] = wp.dot(w.output[s, i], delta_out)
        of_h = both()
        for side in range(sides):
            if sides == 2:
                open = w.gates[s, OUTPUT_DOMINANT + side]
                last = a.hidden[k, (layers - 1) * sides + side]
                d.combination[stream, trial, side] = d.combination[stream, trial, side] + open * wp.dot(
                    of_combined, last
                )
                of_h[side] = open * w.combination[s, side] * of_combined
            else:
                of_h[side] = of_combined
        of_observation = vec_in()
        for back in range(layers):
            layer = layers - 1 - back
            of_received = both()
            for side in range(sides):
                row = layer * sides + side
                h = a.hidden[k, row]
                of_active = of_h[side]
                if d.activity.shape[1] > 0:
                    of_active = of_active + d.activity[stream, k, row]
                delta = vec_side()
                for i in range(width):
                    delta[i] = of_active[i] * (real(1.0) - h[i] * h[i])
                d.hidden[k, stream, row] = delta
                if layer > 0:
                    for i in range(width):
                        of_received[side, i] = wp.dot(w.hidden[s, row - sides, i], delta)
                else:
                    open_in = w.gates[s, INPUT_DOMINANT + side]
                    for i in range(n_inputs):
                        of_observation[i] += open_in * wp.dot(w.first[s, side, i], delta)
            if layer > 0:
                of_h = of_received
                if callosal:
                    sent = both()
                    for side in range(sides):
                        sent[side] = a.hidden[k, (layer - 1) * sides + side]
                    of_h = exchange_adjoint(sent, w.gates[s, CALLOSUM], of_received)
        return of_observation

    return SimpleNamespace(
        Weights=Weights, Activity=Activity, Deltas=Deltas, excite=excite, excite_adjoint=excite_adjoint,
        vec_in=vec_in, vec_in_one=vec_in_one, vec_out=vec_out, vec_side=vec_side, vec_side_one=vec_side_one,
    )  # fmt: skip
