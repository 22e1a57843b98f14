"""A batch of arms doing trials: the one thing that every environment face wraps."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import NDArray

from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import kernel_parameters
from bilateral_rl.envs.arm.warp_start import start_warp
from bilateral_rl.envs.reward import stream_weights
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.tasks import Task, Trials
from bilateral_rl.envs.trial_kernels import (
    N_NOISE,
    N_OBSERVED,
    N_SENSED,
    TrialArrays,
    load_kernels,
    rows,
    start_trials,
    step_trials,
    vec2,
    vec4,
    vec6,
)

Float32 = NDArray[np.float32]


class Draws(NamedTuple):
    """Random numbers of ``k`` trials of one arm, in the order in which its generator yields them."""

    uniform: NDArray[np.float64]
    """(k, n_uniform) in [0, 1)."""
    noise: NDArray[np.float64] | None
    """(k, T + 1, 20) standard normal; None where the settings have no noise."""


class TrialBatch:
    """``n`` arms doing trials of ``task``, each with its own clock.

    On a CPU every array below is a live view of the kernels' memory; on CUDA it is the host's copy, refreshed by each
    call. Read them, or copy what must outlive the next call.

    Args:
        task: the distribution of trials.
        settings: how they run.
        n: number of arms.
        device: ``"cpu"`` or a CUDA device.

    Raises:
        ValueError: no arm.

    Attributes:
        observation: (n, 16) float32.
        reward: (n,) float32, mean of the two streams.
        vector_reward: (n, 2) float32, dominant and non-dominant.
        vector_return: (n, 2) float32, sums since each trial's start.
        distance: (n, T) float32, hand to target after each step (m); entries from a trial's clock on are stale.
        start_distance: (n,) float32 (m).
        clock: (n,) int32, steps since each trial's start.
        joint: (n, 4) float32, angles (rad) and velocities (rad/s).
        muscle: (n, 7, 6) float32, rows as in :class:`~bilateral_rl.envs.arm.ArmState`.
        hand, target: (n, 2) float32 (m).
        load: (n, 2) float32 (N).
        excitation: (n, 6) float32, the last step's commands in [0, 1], before motor noise.
    """

    # The annotations are also the list of what is copied from the device: see _OUTPUTS.
    observation: Float32
    reward: Float32
    vector_reward: Float32
    vector_return: Float32
    distance: Float32
    start_distance: Float32
    clock: NDArray[np.int32]
    joint: Float32
    muscle: Float32
    hand: Float32
    target: Float32
    load: Float32
    excitation: Float32

    def __init__(self, task: Task, settings: TrialSettings, n: int, device: str = "cpu") -> None:
        if n < 1:
            raise ValueError(f"at least one arm is needed, got {n}.")
        start_warp()
        self.task, self.settings, self.n, self.device = task, settings, n, device
        self._on_cpu = wp.get_device(device).is_cpu
        load_kernels(device)
        self._p = kernel_parameters(settings.arm, wp.float32)
        self._arrays = _allocate(settings, n, device)
        self._action = wp.zeros(n, dtype=vec6, device=device)
        self._host_action = self._action.numpy()
        self._host_noise = self._arrays.noise.numpy()
        self._noise_scale = np.array([settings.sensory_noise] * N_SENSED + [settings.motor_noise] * N_MUSCLES)
        self._step_command = wp.launch(
            step_trials,
            dim=n,
            inputs=[self._p, stream_weights(), self._action, self._arrays],
            device=device,
            record_cmd=True,
        )
        self._fetch()

    def draw(self, generator: np.random.Generator, k: int = 1) -> Draws:
        """Return the numbers of the next ``k`` trials of one arm (1 where noise is drawn between trials)."""
        if not self.settings.noisy:
            return Draws(generator.random((k, self.task.n_uniform)), None)
        shape = (1, self.settings.trial_length + 1, N_NOISE)
        return Draws(generator.random((1, self.task.n_uniform)), generator.standard_normal(shape))

    def start(self, arms: NDArray[np.int32], trials: Trials, noise: NDArray[np.float64] | None = None) -> None:
        """Begin the k ``trials`` on the k ``arms``, with their normal numbers (k, T + 1, 20) if noisy."""
        if noise is not None:
            self._host_noise[arms] = noise * self._noise_scale
            if not self._on_cpu:
                self._arrays.noise.assign(self._host_noise)
        wp.launch(
            start_trials,
            dim=len(arms),
            inputs=[
                self._p,
                self._arrays,
                wp.array(arms, dtype=wp.int32, device=self.device),
                *(wp.array(values, dtype=vec2, device=self.device) for values in trials),
            ],
            device=self.device,
        )
        if not self._on_cpu:
            self._fetch()

    def step(self, action: NDArray[np.float32]) -> None:
        """Make one step of every arm under ``action`` (n, 6) in [-1, 1]; outside values act as the nearest bound.

        Raises:
            ValueError: another shape (one arm also takes (6,)), or a number that is not finite.
        """
        shape = self._host_action.shape
        if np.shape(action) != shape and (self.n > 1 or np.shape(action) != shape[1:]):
            raise ValueError(f"actions must have shape {shape}, got {np.shape(action)}.")
        if not np.isfinite(action).all():
            raise ValueError("actions must be finite numbers: has the policy diverged?")
        self._host_action[:] = action
        if not self._on_cpu:
            self._action.assign(self._host_action)
        self._step_command.launch()
        if not self._on_cpu:
            self._fetch()

    @contextlib.contextmanager
    def standing(self, arms: NDArray[np.bool_]) -> Iterator[None]:
        """A context in which steps leave ``arms`` (n,), whose trials have just begun, as they are."""
        kept = {name: array[arms].copy() for name, array in self.state_arrays().items()}
        yield
        for name, array in self.state_arrays().items():
            array[arms] = kept[name]
            if not self._on_cpu:
                getattr(self._arrays, name).assign(array)
        if not self._on_cpu:
            self._fetch()

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Return everything that the rest of the trials depends on, by name; on a CPU these are live views."""
        return {name: getattr(self._arrays, name).numpy() for name in _STATE}

    def set_state_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go on from the state that :meth:`state_arrays` returned.

        Raises:
            ValueError: arrays of another shape or type, or numbers that such a batch cannot come to.
        """
        for name, present in self.state_arrays().items():
            check_array(name, arrays.get(name), present)
        if (arrays["clock"] < 0).any() or (arrays["clock"] > self.settings.trial_length).any():
            raise ValueError("clock is outside the trial")  # the kernels trust it as an index
        for name in _STATE:
            getattr(self._arrays, name).assign(np.ascontiguousarray(arrays[name]))
        self._host_noise = self._arrays.noise.numpy()
        self._fetch()

    def __getstate__(self) -> dict[str, Any]:
        arrays = self.state_arrays()
        return {"task": self.task, "settings": self.settings, "n": self.n, "device": self.device, "arrays": arrays}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(state["task"], state["settings"], state["n"], state["device"])  # type: ignore[misc]
        self.set_state_arrays(state["arrays"])

    def _fetch(self) -> None:
        """Make the attributes the kernels' arrays: views on a CPU, copies of what is on another device."""
        for name in _OUTPUTS:
            setattr(self, name, getattr(self._arrays, name).numpy())


_OUTPUTS = tuple(TrialBatch.__annotations__)
"""Names of the batch's arrays, which are those of the kernels' struct: an array that is annotated is offered."""
_STATE = (*_OUTPUTS, "noise", "sensed")
"""Names of the arrays that a saved state holds."""


def check_array(name: str, array: NDArray[Any] | None, like: NDArray[Any]) -> None:
    """Check an array of a saved state.

    Raises:
        ValueError: it is missing, of another shape or type than ``like``, or not finite.
    """
    if array is None or array.shape != like.shape or array.dtype != like.dtype:
        raise ValueError(f"{name} is not a {like.dtype} array of shape {like.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} is not finite")


def _allocate(settings: TrialSettings, n: int, device: str) -> TrialArrays:
    """Return the kernels' struct with arrays of zeros on ``device``."""
    length = settings.trial_length
    shapes: dict[str, tuple[tuple[int, ...], Any]] = {
        "clock": ((n,), wp.int32),
        "joint": ((n,), vec4),
        "muscle": ((n,), rows),
        "hand": ((n,), vec2),
        "target": ((n,), vec2),
        "load": ((n,), vec2),
        "noise": ((n, length + 1 if settings.noisy else 1, N_NOISE), wp.float32),
        "sensed": ((n, settings.feedback_delay + 1, N_SENSED), wp.float32),
        "observation": ((n, N_OBSERVED), wp.float32),
        "excitation": ((n,), vec6),
        "vector_reward": ((n,), vec2),
        "reward": ((n,), wp.float32),
        "vector_return": ((n,), vec2),
        "start_distance": ((n,), wp.float32),
        "distance": ((n, length), wp.float32),
    }
    arrays = TrialArrays()
    for name, (shape, dtype) in shapes.items():
        setattr(arrays, name, wp.zeros(shape, dtype=dtype, device=device))
    low, high = settings.observation_bounds()
    arrays.observation_low = wp.array(low, dtype=wp.float32, device=device)
    arrays.observation_high = wp.array(high, dtype=wp.float32, device=device)
    return arrays
