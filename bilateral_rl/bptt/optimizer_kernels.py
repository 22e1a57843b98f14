"""One thread a variable of one network: routing, clipping and Adam (paper section 5).

Written out because the paper's optimizer is Keras's: every kernel, bias and scalar is clipped by its own norm, and ε is
added before the bias correction, unlike in torch's Adam. With a thread for each, networks of a stack cannot influence
each other, not even by rounding.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

BETA_1, BETA_2 = 0.9, 0.999


@functools.cache
def optimizer_kernels(real: Any) -> SimpleNamespace:
    """The kernels ``route`` and ``adam`` in precision ``real``, for (networks, variables) threads."""
    new_1, new_2 = real(1.0 - BETA_1), real(1.0 - BETA_2)  # a plain number would be rounded to single precision

    @wp.kernel(module="unique", enable_backward=False)
    def route(
        gradient: wp.array3d(dtype=real),
        weights: wp.array2d(dtype=real),
        decay: wp.array(dtype=real),
        shares: wp.array2d(dtype=real),
        offsets: wp.array(dtype=int),
        routed: wp.array2d(dtype=real),
        norms: wp.array2d(dtype=real),
    ) -> None:
        """A variable's gradient: its shares of the streams' gradients and weight decays; and its norm."""
        s, v = wp.tid()
        total = real(0.0)
        for i in range(offsets[v], offsets[v + 1]):
            of_losses = real(0.0)
            for stream in range(gradient.shape[0]):
                if shares[stream, v] != real(0.0):
                    of_loss = gradient[stream, s, i] + decay[stream] * weights[s, i]
                    of_losses += shares[stream, v] * of_loss
            routed[s, i] = of_losses
            total += of_losses * of_losses
        norms[s, v] = wp.sqrt(total)

    @wp.kernel(module="unique", enable_backward=False)
    def adam(
        routed: wp.array2d(dtype=real),
        norms: wp.array2d(dtype=real),
        offsets: wp.array(dtype=int),
        non_negative: wp.array(dtype=int),
        trains: wp.array2d(dtype=int),
        clip_norm: real,
        rate: real,
        epsilon: real,
        first: wp.array2d(dtype=real),
        second: wp.array2d(dtype=real),
        weights: wp.array2d(dtype=real),
    ) -> None:
        """One step of Adam on a variable that trains."""
        s, v = wp.tid()
        if trains[s, v] == 0:
            return
        norm = wp.max(norms[s, v], clip_norm)
        for i in range(offsets[v], offsets[v + 1]):
            clipped = routed[s, i] * clip_norm / norm
            first[s, i] = first[s, i] + (clipped - first[s, i]) * new_1
            second[s, i] = second[s, i] + (clipped * clipped - second[s, i]) * new_2
            moved = weights[s, i] - rate * first[s, i] / (wp.sqrt(second[s, i]) + epsilon)
            if non_negative[v] != 0:
                moved = wp.max(moved, real(0.0))
            weights[s, i] = moved

    return SimpleNamespace(route=route, adam=adam)
