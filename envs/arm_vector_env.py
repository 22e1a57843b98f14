"""The Gymnasium vector face: many arms."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, SupportsIndex

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm_env import ArmEnv, with_time_limit
from bilateral_rl.envs.doors import checked_seed, settings_for, whole_number
from bilateral_rl.envs.infos import final_infos
from bilateral_rl.envs.refusals import shown
from bilateral_rl.envs.running_arms import RunningArms
from bilateral_rl.envs.scene import MAX_DRAWN, SceneView, render_fps
from bilateral_rl.envs.tasks import TaskLike, make_task
from bilateral_rl.envs.trial_streams import TrialStreams
from bilateral_rl.envs.trials import TrialBatch

if TYPE_CHECKING:
    import torch

Float32 = NDArray[np.float32]
Mask = NDArray[np.bool_]
"""(num_envs,): some of the arms."""


class ArmVectorEnv(RunningArms, VectorEnv[Float32, Float32, NDArray[Any]]):
    """``num_envs`` arms, or pairs of arms, in one kernel launch, as the ``VectorEnv`` of ``gymnasium.make_vec``.

    Spaces, reward, start, end and info are :class:`~bilateral_rl.envs.arm_env.ArmEnv`'s. What follows the end of an
    arm's trial is said by ``autoreset_mode``, as in Gymnasium's own vector environments:

    - ``"SameStep"``: the next trial begins in the same step. The observation is the next trial's;
      ``infos["final_obs"]`` holds the last one, and ``infos["final_info"]`` the whole info of the last step.
      ``infos["vector_reward"]`` and ``infos["distance"]`` are the last step's too, for every arm at every step.
    - ``"NextStep"``: the observation and the info are the last ones; the next step begins the arm's next trial,
      whatever its action, and returns a reward of 0. Gymnasium's ``NormalizeObservation`` asks for this mode.
    - ``"Disabled"``: nothing follows; ``reset(options={"reset_mask": mask})`` begins the next trials of these arms.

    Of two arms ``infos["holds"]`` (num_envs, 2) bool says which hands are to hold, for the pairs in
    ``infos["_holds"]``: at :meth:`reset`, and at a step that begins a trial, in the trial that begins; at the last step
    in the trial that ends, which in the same-step mode stands in ``infos["final_info"]``, besides the next trial's.

    Args:
        num_envs: number of arms, or of pairs of arms in a task of two.
        task, render_mode, **settings: as for :class:`~bilateral_rl.envs.arm_env.ArmEnv`.
        device: ``"cpu"`` or a CUDA device.
        autoreset_mode: one of Gymnasium's ``AutoresetMode``, or its value.

    Raises:
        TypeError, ValueError: as for :class:`~bilateral_rl.envs.arm_env.ArmEnv`, or an unknown mode.
    """

    metadata: dict[str, Any] = ArmEnv.metadata | {"autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(
        self,
        num_envs: SupportsIndex = 1,
        task: TaskLike = "random_reach",
        render_mode: str | None = None,
        device: str | torch.device = "cpu",
        autoreset_mode: str | AutoresetMode = AutoresetMode.SAME_STEP,
        **settings: Any,
    ) -> None:
        task = make_task(task)
        trials = settings_for(task, with_time_limit(settings, settings.pop("max_episode_steps", None)))
        self.batch = TrialBatch(task, trials, num_envs, device)
        self.settings, self.num_envs = self.batch.settings, self.batch.n
        self.render_mode = render_mode
        self._mode = _mode(autoreset_mode)
        fps = render_fps(trials.arm.timestep)
        self.metadata = self.metadata | {"autoreset_mode": self._mode, "render_fps": fps}
        # Gymnasium wants a picture of every arm; a window has no room for them.
        self._view = SceneView(self.batch, render_mode, MAX_DRAWN if render_mode == "human" else self.num_envs)
        self._streams: TrialStreams | None = None
        self._ended = np.zeros(self.num_envs, dtype=np.bool_)
        low, high = self.settings.observation_bounds(task.n_arms)
        self.single_observation_space = spaces.Box(low, high)
        self.single_action_space = spaces.Box(-1.0, 1.0, (task.n_arms * N_MUSCLES,))
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32, dict[str, Any]]:
        """Start a new trial on every arm; arm i from ``seed + i``, or from the i-th of a list of seeds.

        Args:
            seed: one for all, or one an arm; where it is None, the arm's trials go on.
            options: ``{"reset_mask": mask}``, (num_envs,) bool, starts these arms alone.

        Raises:
            TypeError, ValueError: other options, a mask that is none, or as many seeds as there are no arms.
        """
        arms = self._chosen(options or {})
        if isinstance(seed, SupportsIndex):
            first = whole_number("seed", seed, 0)
            seed = [first + arm for arm in range(self.num_envs)]
        if seed is None:
            seed = [None] * self.num_envs
        if len(seed) != self.num_envs:
            raise ValueError(f"{self.num_envs} arms need {self.num_envs} seeds, got {len(seed)}.")
        seeds = [checked_seed(one) if chosen else None for one, chosen in zip(seed, arms, strict=True)]
        if self._streams is None:
            if not arms.all():
                raise RuntimeError("the first reset() starts every arm: call it without a reset_mask.")
            self._streams = TrialStreams(self.batch, seeds)
        else:
            self._streams.reseed(seeds)
        self._start(arms)
        self._ended[arms] = False
        self._view.advance()
        return self.batch.observation.copy(), self._begun_infos(arms)

    def step(self, actions: Float32) -> tuple[Float32, Float32, Mask, Mask, dict[str, Any]]:
        """Make a step of every arm.

        Args:
            actions: (num_envs, 6), of two arms (num_envs, 12), in [-1, 1]; outside values act as the nearest bound.

        Returns:
            Observations (num_envs, 16), of two arms (num_envs, 40), rewards, terminations (never), truncations, and
            infos with their masks.

        Raises:
            ValueError: actions of another shape, or that are not finite.
            RuntimeError: before the first :meth:`reset`, or for an arm whose trial is over if autoreset is disabled.
        """
        batch = self.batch
        if self._streams is None:
            raise RuntimeError("call reset() before the first step().")
        if self._mode is AutoresetMode.DISABLED and self._ended.any():
            over = np.flatnonzero(self._ended).tolist()
            raise RuntimeError(f'the trials of the arms {over} are over: reset(options={{"reset_mask": …}}) first.')
        begun = self._ended  # in the next-step mode alone, there are any
        if begun.all():
            batch.checked_action(actions)
        else:
            batch.step(actions)  # where a trial is over, an arm stands still
        if begun.any():
            self._start(begun)
        begun_infos = self._begun_infos(begun)
        moved = ~begun
        self._ended = batch.clock >= batch.settings.trial_length
        truncated = self._ended.copy()
        rewards = np.where(moved, batch.reward, np.float32(0))
        infos = self._add_infos(begun_infos, moved)
        if self._mode is AutoresetMode.SAME_STEP and truncated.any():
            self._start(truncated)
            self._ended[:] = False
            infos |= self._begun_infos(truncated)
        self._view.advance()
        return batch.observation.copy(), rewards, np.zeros(self.num_envs, dtype=np.bool_), truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return one (480, 480, 3) RGB picture an arm in mode "rgb_array"; in mode "human" each step shows some."""
        return tuple(self._view.pictures()) if self.render_mode == "rgb_array" else None

    def close_extras(self, **kwargs: Any) -> None:
        if "_view" in vars(self):  # Gymnasium closes what could not be made, too
            self._view.close()

    def _chosen(self, options: dict[str, Any]) -> Mask:
        """Return the arms that :meth:`reset` starts."""
        if unknown := sorted(set(options) - {"reset_mask"}):
            raise ValueError(f"ArmVectorEnv draws its trials and takes no reset options but reset_mask, got {unknown}.")
        if "reset_mask" not in options:
            return np.ones(self.num_envs, dtype=np.bool_)
        mask = options["reset_mask"]
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            raise TypeError(f"reset_mask must be a NumPy array of bool, got {shown(mask)}.")
        if mask.shape != (self.num_envs,) or not mask.any():
            raise ValueError(f"reset_mask must choose one or more of {self.num_envs} arms, got {shown(mask)}.")
        return mask.copy()

    def _start(self, arms: Mask) -> None:
        """Begin the next trial of each of ``arms``."""
        assert self._streams is not None
        self._streams.start(np.flatnonzero(arms).astype(np.int32))

    def _distance(self) -> NDArray[np.float64]:
        """Return the distances to the targets after the last step (m): (num_envs,), of two arms (num_envs, 2)."""
        batch = self.batch
        steps = np.repeat(batch.clock - 1, batch.n_arms)
        distance = batch.distance[np.arange(batch.n_hands), steps].astype(float)
        return distance if batch.n_arms == 1 else distance.reshape(-1, batch.n_arms)

    def _begun_infos(self, arms: Mask) -> dict[str, Any]:
        """Return what infos say of the trials of ``arms``, which begin."""
        assert self._streams is not None
        holds = self._streams.holds
        if holds is None or not arms.any():
            return {}
        return {"holds": holds & arms[:, None], "_holds": arms.copy()}

    def _add_infos(self, infos: dict[str, Any], moved: Mask) -> dict[str, Any]:
        """Add the infos of a step that ``moved`` made and the others did not, before trials begin anew."""
        batch = self.batch
        if not moved.any():
            return infos
        distance = self._distance()
        pairs = np.where(moved[:, None], batch.vector_reward, np.float32(0))
        infos |= {"vector_reward": pairs, "_vector_reward": moved.copy()}
        infos |= {"distance": np.where(moved.reshape(-1, *[1] * (distance.ndim - 1)), distance, 0)}
        infos |= {"_distance": moved.copy()}
        over = np.flatnonzero(self._ended)
        assert self._streams is not None
        holds = None if self._streams.holds is None else self._streams.holds[over]
        for arm, final in zip(over.tolist(), final_infos(batch, over.astype(np.int32), holds), strict=True):
            if self._mode is AutoresetMode.SAME_STEP:
                last = {"vector_reward": pairs[arm], "distance": distance[arm], **final}
                final = {"final_obs": batch.observation[arm].copy(), "final_info": last}
            infos = self._add_info(infos, final, arm)
        return infos


def _mode(name: str | AutoresetMode) -> AutoresetMode:
    try:
        return AutoresetMode(name)
    except ValueError:
        known = ", ".join(repr(mode.value) for mode in AutoresetMode)
        raise ValueError(f"unknown autoreset_mode {shown(name)}; choose from {known}.") from None
