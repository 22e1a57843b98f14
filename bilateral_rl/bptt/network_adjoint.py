"""Gradients back through the networks of ``network_kernels.py`` for one sample, as Warp functions.

They stop at each layer's deltas: the gradients of the weights are products of matrices over all samples, which are left
to torch (``Rollout.backward``). ``d_x`` is the gradient of a stream's loss with respect to x.
"""

import functools
from typing import Any

import warp as wp

from bilateral_rl.bptt.network_kernels import CALLOSUM, INPUT_DOMINANT, OUTPUT_DOMINANT, NetworkShape, network_types


@functools.cache
def network_adjoint(real: Any, shape: NetworkShape, noisy: bool) -> Any:
    """Return the Warp function ``excite_adjoint`` of the networks of ``network_forward``."""
    vec_in, _, vec_out, vec_arm, vec_side, _, both, Weights, Activity, Deltas = network_types(real, shape)
    _, _, width, layers, sides, callosal, arms = shape
    n_seen, n_muscles = shape.n_seen, shape.n_muscles
    apart = shape.seen_by(1).start  # from the first input of one side to the first of the other
    pooled = width // 2  # numbers that a side sends over the callosum
    kept = width - pooled  # units of a side that receive nothing

    @wp.func
    def exchange_adjoint(h: both, open: real, gradient: both) -> both:
        """Return the gradient with respect to what was held before, ``h``, from that with respect to what was received.

        What a side held goes on to itself as it is, and to the other side if it was the larger of its pair; of two
        equals the first one gets the gradient, as in torch.
        """
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
        """Return the gradient with respect to the observation from that with respect to the excitation; fills ``d``.

        Layer by layer, from the last to the first, and gate by gate: a delta is the gradient with respect to what goes
        into a nonlinearity, that of what comes out of it times its slope, x (1 − x) for the logistic, 1 − h² for tanh.
        """
        # Output layers and combination.
        d_h = both()
        for arm in range(arms):
            delta_out = vec_arm()
            for i in range(n_muscles):
                command = excitation[arm * n_muscles + i]
                delta_out[i] = gradient[arm * n_muscles + i] * command * (real(1.0) - command)
            d.output[k, stream, arm] = delta_out
            d_combined = vec_side()
            for i in range(width):
                d_combined[i] = wp.dot(w.output[s, arm, i], delta_out)
            for side in range(sides):
                if sides == 2:
                    open = w.gates[s, OUTPUT_DOMINANT + side]
                    last = a.hidden[k, (layers - 1) * sides + side]
                    d.combination[stream, trial, side, arm] = d.combination[stream, trial, side, arm] + open * wp.dot(
                        d_combined, last
                    )
                    d_h[side] = d_h[side] + open * w.combination[s, side, arm] * d_combined
                else:
                    d_h[side] = d_combined
        # Hidden layers; ``d_h`` is with respect to the activity of the layer at hand, both sides'.
        d_observation = vec_in()
        for back in range(layers):
            layer = layers - 1 - back
            d_received = both()
            for side in range(sides):
                row = layer * sides + side
                h = a.hidden[k, row]
                if noisy:
                    h = h - a.noise[k, row]  # the slope is that of the tanh alone
                d_active = d_h[side]
                if d.activity.shape[1] > 0:
                    d_active = d_active + d.activity[stream, k, row]
                delta = vec_side()
                for i in range(width):
                    delta[i] = d_active[i] * (real(1.0) - h[i] * h[i])
                d.hidden[k, stream, row] = delta
                if layer > 0:
                    for i in range(width):
                        d_received[side, i] = wp.dot(w.hidden[s, row - sides, i], delta)
                else:
                    open_in = w.gates[s, INPUT_DOMINANT + side]
                    for i in range(n_seen):
                        d_observation[side * apart + i] += open_in * wp.dot(w.first[s, side, i], delta)
            # Back over the callosum, whose pooling depends on what the layer before had sent.
            if layer > 0:
                d_h = d_received
                if callosal:
                    sent = both()
                    for side in range(sides):
                        sent[side] = a.hidden[k, (layer - 1) * sides + side]
                    d_h = exchange_adjoint(sent, w.gates[s, CALLOSUM], d_received)
        return d_observation

    return excite_adjoint
