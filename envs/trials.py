"""A batch of trials, of one arm or two: the one thing that every environment face wraps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, SupportsIndex

import numpy as np
import warp as wp
from numpy.typing import NDArray

from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import kernel_parameters
from bilateral_rl.envs.arm.warp_start import known_device
from bilateral_rl.envs.doors import checked_arms, numbers, renewed, whole_number
from bilateral_rl.envs.refusals import shown
from bilateral_rl.envs.reward import step_weights
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.task import Task, Trials
from bilateral_rl.envs.trial_arrays import (
    N_NOISE,
    OF_FORCES,
    OF_SPRING,
    OF_TIMELINE,
    Features,
    allocate,
    state_names,
    trial_rows,
    vec6,
)
from bilateral_rl.envs.trial_checks import checked_trials
from bilateral_rl.envs.trial_kernels import load_kernels, trial_kernels

if TYPE_CHECKING:
    import torch

Float32 = NDArray[np.float32]

MOST_ARMS = 1_000_000
"""So many take gigabytes; a number that is far larger is a mistake, and would have the system end the process."""


class Draws(NamedTuple):
    """Random numbers of ``k`` trials, one after the other, in the order in which their generator yields them."""

    uniform: NDArray[np.float64]
    """(k, n_uniform) in [0, 1)."""
    noise: NDArray[np.float64] | None
    """(k · arms, T + 1, 20) standard normal, with k = 1; None where the settings have no noise."""


class TrialBatch:
    """``n`` trials of ``task`` at once, each of one arm, or of two, with a clock of its own.

    On a CPU every array below is a live view of the kernels' memory: copy what must outlive the next call. Writing into
    ``joint``, ``muscle``, ``target`` or ``load`` (``batch.load[:] = ...``) acts on the next step; ``observation`` and
    the sums follow then, and a timeline still changes the target when its time comes. On CUDA the arrays are copies
    that cannot be written into. No attribute can be replaced: the kernels know the memory, not the name.

    What an arm has of its own is in arrays of ``h`` = n · arms rows, a trial's dominant arm before its non-dominant
    one, and in the frame of that arm: the shoulder is at the origin and x points away from the midline, so that the
    non-dominant arm is the mirror image (:mod:`bilateral_rl.envs.body_frame` leads to the frame of the body).

    Everything is checked here, before a kernel sees it. No trial runs until :meth:`start` begins one.

    Args:
        task: the distribution of trials.
        settings: how they run; checked again, and copied.
        n: number of trials at once.
        device: ``"cpu"`` or a CUDA device.

    Raises:
        TypeError: another kind of argument.
        ValueError: no trial, a device that there is not, or settings outside their range.

    Attributes:
        n_arms: arms of a trial, the task's.
        n_hands: ``h``, arms of all trials.
        observation: (n, 16) float32, or (n, 40) of two arms: 20 numbers that the dominant arm sees, then the other's.
        reward: (n,) float32, mean of the two streams.
        vector_reward: (n, 2) float32, dominant and non-dominant.
        vector_return: (n, 2) float32, sums since each trial's start.
        distance: (h, T) float32, hand to target after each step (m); entries from a trial's clock on are stale.
        start_distance: (h,) float32, hand to target when the present target began (m).
        clock: (n,) int32, steps since each trial's start, read-only; T where a trial is over, or none has begun.
        onset: (h,) int32, step at which the present target began, read-only: 0 without a timeline, T before the cue.
        joint: (h, 4) float32, angles (rad) and velocities (rad/s).
        muscle: (h, 7, 6) float32, rows as in :class:`~bilateral_rl.envs.arm.ArmState`.
        hand, target: (h, 2) float32 (m); the target is the one that is seen now, which judges the next step.
        load: (h, 2) float32, the constant part of the force on the hand (N).
        force: (h, 2) float32, the whole force on the hand in the last step, read-only (N): load, fields, pulse, walls
            and spring; before the first step, the load.
        excitation: (h, 6) float32, the last step's commands in [0, 1], before motor noise.
    """

    task: Task
    settings: TrialSettings
    n: int
    n_arms: int
    n_hands: int
    device: str
    # What follows is also the list of what is copied from the device: see _OUTPUTS.
    observation: Float32
    reward: Float32
    vector_reward: Float32
    vector_return: Float32
    distance: Float32
    start_distance: Float32
    clock: NDArray[np.int32]
    onset: NDArray[np.int32]
    joint: Float32
    muscle: Float32
    hand: Float32
    target: Float32
    load: Float32
    force: Float32
    excitation: Float32

    def __init__(
        self, task: Task, settings: TrialSettings, n: SupportsIndex, device: str | torch.device = "cpu"
    ) -> None:
        if not isinstance(task, Task):
            raise TypeError(f"task must be a Task, got {shown(task)}.")
        settings, n, device = renewed(settings, TrialSettings), _n_trials(n), known_device(device)
        task.check(settings)
        self.__dict__.update(
            task=task, settings=settings, n=n, n_arms=task.n_arms, n_hands=n * task.n_arms, device=device
        )
        self._n_uniform = whole_number("n_uniform of a task", task.n_uniform, 0)
        self._length = settings.trial_length
        self._steps_left = 0  # at most, of the arm that has most: what reads every clock is asked once a trial
        self._on_cpu = device == "cpu"
        features = _features(task, settings)
        self._kernels = trial_kernels(features)
        load_kernels(self._kernels, device)
        self._p = kernel_parameters(settings.arm, wp.float32)
        *self._structs, self._arrays = allocate(settings, features, n, device)
        self._state_names = (*_STATE, *state_names(features))
        self._action = wp.zeros(self.n_hands, dtype=vec6, device=device)
        self._host_action = self._action.numpy().reshape(n, -1)
        self._host_noise = self._arrays["noise"].numpy()
        self._noise_scale = np.array(settings.noise_scale)
        self._step_command = wp.launch(
            self._kernels.step,
            dim=n,
            inputs=[self._p, step_weights(settings.losses, self._length), self._action, *self._structs],
            device=device,
            record_cmd=True,
        )
        self._fetch()

    def draw(self, generator: np.random.Generator, k: int = 1) -> Draws:
        """Return the numbers of the next ``k`` trials from one generator (1 where noise is drawn between trials)."""
        if self.task.n_uniform != self._n_uniform:
            raise ValueError("n_uniform of a task cannot change while arms run: make a new environment.")
        if not self.settings.noisy:
            return Draws(generator.random((k, self._n_uniform)), None)
        shape = (self.n_arms, self._length + 1, N_NOISE)
        return Draws(generator.random((1, self._n_uniform)), generator.standard_normal(shape))

    def start(self, arms: NDArray[np.int32], trials: Trials, noise: NDArray[np.float64] | None = None) -> None:
        """Begin the k ``trials`` on the k ``arms``, or pairs of arms, at rest; the others go on with theirs.

        Args:
            arms: (k,) whole numbers from 0 to n - 1, each at most once.
            trials: arrays (k, 2), or a single row for all: postures within the joint limits (rad), and loads (N);
                with a timeline and with forces where the task has them. Of two arms (k, 2, 2), in the frame of the
                body, with a spring.
            noise: (k · arms, T + 1, 20) standard normal numbers, which the settings scale: of each step, fourteen for
                what is sensed and six for the muscles. None where the settings have no noise.

        Raises:
            TypeError: no numbers.
            ValueError: another shape, numbers that are not finite, a posture that the arm cannot take, or noise
                where there is none, or none where there is.
        """
        arms = checked_arms(arms, self.n)
        trials = checked_trials(trials, len(arms), self.task, self.settings)
        self._set_noise(arms, noise)
        wp.launch(
            self._kernels.start,
            dim=len(arms),
            inputs=[
                self._p,
                trial_rows(trials, self.settings.arm, self.device),
                wp.array(arms, dtype=wp.int32, device=self.device),
                *self._structs,
            ],
            device=self.device,
        )
        if len(arms):
            self._steps_left = self._length
        if not self._on_cpu:
            self._fetch()

    def _set_noise(self, arms: NDArray[np.int32], noise: object) -> None:
        if noise is None and not self.settings.noisy:
            return
        shape = (len(arms) * self.n_arms, self._length + 1, N_NOISE)
        if noise is None or not self.settings.noisy:
            raise ValueError(f"noise must be {f'{shape} normal numbers' if noise is None else 'None without noise'}.")
        normal = numbers("noise", noise)
        if normal.shape != shape or not np.isfinite(normal).all():
            raise ValueError(f"noise must be finite numbers of shape {shape}, got shape {normal.shape}.")
        self._host_noise[self.hands(arms)] = normal * self._noise_scale
        if not self._on_cpu:
            self._arrays["noise"].assign(self._host_noise)

    def hands(self, trials: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the rows of the hands of ``trials`` (k,) in arrays of hands, (k · arms,)."""
        if self.n_arms == 1:
            return trials
        return (trials[:, None] * self.n_arms + np.arange(self.n_arms)).astype(np.int32).ravel()

    def step(self, action: NDArray[np.float32]) -> None:
        """Make one step of every arm under ``action`` (n, 6 · arms) in [-1, 1]; other values act as the nearest bound.

        An arm that is in no trial stays as it is, and its rewards are 0.

        Raises:
            RuntimeError: no arm is in a trial.
            TypeError: no numbers.
            ValueError: another shape (one trial also takes one row), or a number that is not finite.
        """
        if not self._steps_left:
            self._steps_left = self._length - int(self.clock.min())
            if self._steps_left <= 0:
                raise RuntimeError("no trial has begun, or all are over: call reset() before the next step().")
        action = self.checked_action(action)
        if action.itemsize > self._host_action.itemsize:  # what only double precision holds is out of bounds
            action = np.clip(action, -1.0, 1.0)
        self._host_action[:] = action
        self._steps_left -= 1
        if not self._on_cpu:
            self._action.assign(self._host_action.reshape(-1, N_MUSCLES))
        self._step_command.launch()
        if not self._on_cpu:
            self._fetch()

    def checked_action(self, action: object) -> NDArray[Any]:
        """Return the action of a step as numbers. Raises the TypeError and the ValueErrors of :meth:`step`."""
        array, shape = numbers("actions", action), self._host_action.shape
        if array.shape != shape and (self.n > 1 or array.shape != shape[1:]):
            raise ValueError(f"actions must have shape {shape}, got {array.shape}.")
        if not np.isfinite(array).all():
            raise ValueError("actions must be finite numbers: has the policy diverged?")
        return array

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Return everything that the rest of the trials depends on, by name; on a CPU these are live views."""
        return {name: self._arrays[name].numpy() for name in self._state_names}

    def state_array(self, name: str) -> NDArray[Any]:
        """Return one of :meth:`state_arrays`, without fetching the others from a device."""
        values: NDArray[Any] = self._arrays[name].numpy()
        return values

    def set_state_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go on from the state that :meth:`state_arrays` returned.

        Raises:
            ValueError: arrays of another shape or type, or numbers that such a batch cannot come to.
        """
        self.check_state_arrays(arrays)
        for name in self._state_names:
            self._arrays[name].assign(np.ascontiguousarray(arrays[name]))
        self._host_noise = self._arrays["noise"].numpy()
        self._steps_left = self._length - int(arrays["clock"].min())
        self._fetch()

    def check_state_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Raise the errors of :meth:`set_state_arrays`, and change nothing."""
        if not isinstance(arrays, Mapping):
            raise TypeError(f"a state must be a dictionary of arrays, got {type(arrays).__name__}.")
        for name, present in self.state_arrays().items():
            check_array(name, arrays.get(name), present)
        if (arrays["clock"] < 0).any() or (arrays["clock"] > self._length).any():
            raise ValueError("clock is outside the trial")
        if "onset" in arrays and ((arrays["onset"] < 0) | (arrays["onset"] > self._length)).any():
            raise ValueError("onset is outside the trial")

    def __getstate__(self) -> dict[str, Any]:
        arrays = self.state_arrays()
        return {"task": self.task, "settings": self.settings, "n": self.n, "device": self.device, "arrays": arrays}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(state["task"], state["settings"], state["n"], state["device"])  # type: ignore[misc]
        self.set_state_arrays(state["arrays"])

    def __setattr__(self, name: str, value: object) -> None:
        if name in _KEPT:
            instead = f"write into it, batch.{name}[:] = ..." if name in _OUTPUTS else "make a new environment"
            raise AttributeError(f"{name} of running arms cannot be replaced: {instead}.")
        object.__setattr__(self, name, value)

    def _fetch(self) -> None:
        """Make the attributes the kernels' arrays: views on a CPU, copies of what is on another device."""
        for name in _OUTPUTS:
            array = self.__dict__[name] = self._arrays[name].numpy()
            if name in _READ_ONLY or not self._on_cpu:  # what is written into it would be lost, or mistaken
                array.flags.writeable = False


_FIXED = ("task", "settings", "n", "n_arms", "n_hands", "device")
_KEPT = frozenset(TrialBatch.__annotations__)
_OUTPUTS = tuple(name for name in TrialBatch.__annotations__ if name not in _FIXED)
"""Names of the batch's arrays, which are those of the kernels' struct: an array that is annotated is offered."""
_READ_ONLY = ("clock", "onset", "force")
_STATE = (*(name for name in _OUTPUTS if name not in OF_TIMELINE + OF_FORCES + OF_SPRING), "noise", "sensed")
"""Names of the arrays that every saved state holds; those of timelines and forces follow where there are such."""


def check_array(name: str, array: NDArray[Any] | None, like: NDArray[Any]) -> None:
    """Check an array of a saved state.

    Raises:
        ValueError: it is missing, of another shape or type than ``like``, or not finite.
    """
    if not isinstance(array, np.ndarray) or array.shape != like.shape or array.dtype != like.dtype:
        raise ValueError(f"{name} is not a {like.dtype} array of shape {like.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} is not finite")


def _features(task: Task, settings: TrialSettings) -> Features:
    muscles, hand = settings.delays
    further = not settings.losses.is_of_the_paper
    return Features(task.n_arms, task.has_timeline, task.has_forces, further, muscles != hand)


def _n_trials(n: object) -> int:
    number = whole_number("the number of arms", n, 0)
    if number < 1:
        raise ValueError(f"at least one arm is needed, got {number}.")
    if number > MOST_ARMS:
        raise ValueError(f"at most {MOST_ARMS:,} arms can run at once, got {number:,}.")
    return number
