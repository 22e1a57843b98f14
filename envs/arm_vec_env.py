"""The natively batched stable-baselines3 face."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, SupportsIndex

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm_env import ArmEnv
from bilateral_rl.envs.doors import checked_seed, settings_for
from bilateral_rl.envs.infos import final_infos
from bilateral_rl.envs.running_arms import RunningArms
from bilateral_rl.envs.scene import SceneView, render_fps
from bilateral_rl.envs.tasks import TaskLike, make_task
from bilateral_rl.envs.trial_streams import TrialStreams
from bilateral_rl.envs.trials import TrialBatch, check_array

if TYPE_CHECKING:
    import torch


class ArmVecEnv(RunningArms, VecEnv):
    """``n_envs`` arms, or pairs of arms, in one kernel launch, as a stable-baselines3 ``VecEnv``.

    Spaces, reward, start and end are :class:`~bilateral_rl.envs.arm_env.ArmEnv`'s. An arm whose trial ends starts its
    next one in the same step: the observation returned is the new trial's, and its info holds

    - ``terminal_observation`` (16,), of two arms (40,), and ``TimeLimit.truncated`` True: the end is a time limit,
      never a termination;
    - ``episode``: return ``r``, length ``l`` and time ``t`` as SB3's ``Monitor`` writes them, and the streams' returns
      ``dominant`` and ``non_dominant``;
    - ``vector_return`` (2,): the dominant and the non-dominant stream's return;
    - ``is_success``: goal completion, or, of a hand that holds, being within the threshold after the last step;
      ``speed_to_goal`` (m/step, NaN if not reached), ``time_in_goal`` (steps), ``final_error`` (m). Of two arms these
      three are (2,), and so is ``goal_completion``, which means nothing for a hand that holds; success is that of both;
    - of two arms ``holds`` (2,) bool, which hands were to hold in the trial that ended, the dominant one first.

    Infos of arms in the middle of a trial are empty; the step's vector reward is :attr:`last_vector_reward`. Of two
    arms ``reset_infos[i]["holds"]`` says which hands are to hold in the trial that pair i is in: as in SB3's own
    environments, ``reset_infos`` are of the trial that began last, by :meth:`reset` or by itself.

    Args:
        n_envs: number of arms, or of pairs of arms in a task of two.
        task: as for :class:`~bilateral_rl.envs.arm_env.ArmEnv`.
        render_mode: None, ``"rgb_array"`` or ``"human"``.
        device: where the arms are simulated, ``"cpu"`` or a CUDA device; observations arrive as NumPy arrays.
        seed: arm i uses ``seed + i``, so its trials are those of an ``ArmEnv`` reset with that seed.
        **settings: fields of :class:`~bilateral_rl.envs.settings.TrialSettings`.
    """

    metadata: dict[str, Any] = ArmEnv.metadata

    def __init__(
        self,
        n_envs: SupportsIndex,
        task: TaskLike = "random_reach",
        render_mode: str | None = None,
        device: str | torch.device = "cpu",
        seed: SupportsIndex | None = None,
        **settings: Any,
    ) -> None:
        self.render_mode = render_mode
        task = make_task(task)
        self.batch = TrialBatch(task, settings_for(task, settings), n_envs, device)
        self.settings, n = self.batch.settings, self.batch.n
        low, high = self.settings.observation_bounds(task.n_arms)
        super().__init__(n, spaces.Box(low, high), spaces.Box(-1.0, 1.0, (task.n_arms * N_MUSCLES,)))
        # After SB3 has put modes alone there, so that its VecVideoRecorder finds the rate.
        self.metadata |= {"render_fps": render_fps(self.settings.arm.timestep)}
        self._view = SceneView(self.batch, render_mode)
        self._arms = np.arange(n, dtype=np.int32)
        self._streams: TrialStreams | None = None
        self._action = np.zeros((n, task.n_arms * N_MUSCLES), dtype=np.float32)
        self._began = time.monotonic()
        if seed is not None:
            self.seed(seed)

    @property
    def last_vector_reward(self) -> NDArray[np.float32]:
        """(n_envs, 2) float32: the last step's dominant and non-dominant reward; their mean was the reward."""
        return self._vector_reward

    def seed(self, seed: SupportsIndex | None = None) -> Sequence[int | None]:
        """Give arm i the seed ``seed + i``, used at the next reset; a random one for None."""
        return super().seed(checked_seed(seed))

    def seed_arms(self, seeds: Sequence[SupportsIndex | None]) -> None:
        """Give each arm a seed of its own, used at the next reset; :meth:`seed` gives arm i ``seed + i``.

        Raises:
            ValueError: another number of seeds than of arms.
        """
        checked = [checked_seed(seed) for seed in seeds]
        if len(checked) != self.num_envs:
            raise ValueError(f"{self.num_envs} arms need {self.num_envs} seeds, got {len(checked)}.")
        self._seeds = checked

    def reset(self) -> VecEnvObs:
        """Start a new trial on every arm, from the seeds of :meth:`seed` if it was called since the last reset.

        Returns:
            The observations (n_envs, 16), of two arms (n_envs, 40).

        Raises:
            ValueError: reset options were set.
        """
        if any(self._options):
            self._reset_options()
            raise ValueError("ArmVecEnv draws its trials and takes no reset options; ArmEnv.reset(options=...) does.")
        if self._streams is None:
            self._streams = TrialStreams(self.batch, self._seeds)
        else:
            self._streams.reseed(self._seeds)
        self._streams.start(self._arms)
        self._view.advance()
        self._vector_reward = np.zeros((self.num_envs, 2), dtype=np.float32)
        self._reset_seeds()
        self._reset_options()
        self.reset_infos = [{} for _ in range(self.num_envs)]
        self._tell_who_holds(self._arms)
        return self.batch.observation.copy()

    def step_async(self, actions: NDArray[np.float32]) -> None:
        self._action = actions

    def step_wait(self) -> VecEnvStepReturn:
        if self._streams is None:
            raise RuntimeError("call reset() before the first step().")
        batch = self.batch
        batch.step(self._action)
        self._vector_reward = batch.vector_reward.copy()
        reward = batch.reward.copy()
        done = batch.clock >= self.settings.trial_length
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if done.any():
            finished = self._arms[done]
            for arm, info in zip(finished, self._final_infos(finished), strict=True):
                infos[arm] = info
            self._streams.start(finished)
            self._tell_who_holds(finished)
        self._view.advance()
        return batch.observation.copy(), reward, done, infos

    def _final_infos(self, arms: NDArray[np.int32]) -> list[dict[str, Any]]:
        """Return the infos of ``arms``, whose trials have just ended and not yet begun anew."""
        assert self._streams is not None
        holds = self._streams.holds
        infos = final_infos(self.batch, arms, None if holds is None else holds[arms])
        elapsed = round(time.monotonic() - self._began, 6)
        for info, observation in zip(infos, self.batch.observation[arms], strict=True):
            info["terminal_observation"] = observation
            info["TimeLimit.truncated"] = True
            dominant, non_dominant = info["vector_return"].tolist()
            info["episode"] = {
                "r": (dominant + non_dominant) / 2,
                "l": self.settings.trial_length,
                "t": elapsed,
                "dominant": dominant,
                "non_dominant": non_dominant,
            }
        return infos

    def _tell_who_holds(self, arms: NDArray[np.int32]) -> None:
        """Put into the reset infos which hands are to hold in the trials of ``arms``, which begin."""
        assert self._streams is not None
        if self._streams.holds is not None:
            for arm, holds in zip(arms.tolist(), self._streams.holds[arms], strict=True):
                self.reset_infos[arm] = {"holds": holds}

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Return everything that the rest of the trials depends on, by name; call it after :meth:`reset`.

        On a CPU some arrays are live views: save or copy them before the next step.
        """
        assert self._streams is not None
        elapsed = np.array(time.monotonic() - self._began)
        return {"elapsed": elapsed, **self.batch.state_arrays(), **self._streams.state_arrays()}

    def set_state_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go on from the state that :meth:`state_arrays` of as many arms returned, in place of :meth:`reset`.

        Raises:
            ValueError: arrays of another shape or type, or numbers that such an environment cannot come to.
        """
        if not isinstance(arrays, Mapping):
            raise TypeError(f"a state must be a dictionary of arrays, got {type(arrays).__name__}.")
        self.reset()
        assert self._streams is not None
        present = self.state_arrays()
        if extra := sorted(set(arrays) - set(present)):
            raise ValueError(f"{extra[0]} is unknown")
        check_array("elapsed", arrays.get("elapsed"), present["elapsed"])
        self.batch.check_state_arrays(arrays)
        if arrays["elapsed"] < 0 or (arrays["clock"] >= self.settings.trial_length).any():
            raise ValueError("elapsed or clock is out of range")
        self._streams.set_state_arrays(arrays)
        self._tell_who_holds(self._arms)
        self.batch.set_state_arrays(arrays)
        self._began = time.monotonic() - float(arrays["elapsed"])
        self._view.advance()

    def render(self, mode: str | None = None) -> NDArray[np.uint8] | None:
        """Return a picture (H, W, 3) of the first arms in mode "rgb_array"; in mode "human" each step shows them.

        Raises:
            ValueError: a ``mode`` other than the environment's ``render_mode``.
        """
        if mode is not None and mode != self.render_mode:
            raise ValueError(f"these arms were made with render_mode={self.render_mode!r}, and cannot render {mode!r}.")
        return self._view.render()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        return self._view.pictures()

    def close(self) -> None:
        self._view.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute for all arms; settings, and names that would have no effect, are refused."""
        self.refuse_change(attr_name, value)
        if not hasattr(self, attr_name):
            raise AttributeError(f"an ArmVecEnv has no attribute {attr_name!r}: setting it would have no effect.")
        if list(self._get_indices(indices)) != list(range(self.num_envs)):
            raise ValueError("the arms of an ArmVecEnv share their attributes: set them for all, without indices.")
        setattr(self, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        raise AttributeError(f"ArmVecEnv holds one batch, not {self.num_envs} environments: it has no {method_name!r}.")

    def env_is_wrapped(self, wrapper_class: type, indices: VecEnvIndices = None) -> list[bool]:
        # SB3 asks about Monitor, whose statistics the infos already carry.
        return [wrapper_class is Monitor] * len(list(self._get_indices(indices)))
