"""The Gymnasium vector face: many arms."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from bilateral_rl.envs.arm_env import ArmEnv
from bilateral_rl.envs.arm_vec_env import ArmVecEnv
from bilateral_rl.envs.tasks import Task

Float32 = NDArray[np.float32]


class ArmVectorEnv(VectorEnv[Float32, Float32, NDArray[Any]]):
    """``num_envs`` arms in one kernel launch, as a Gymnasium ``VectorEnv``: the one of ``gymnasium.make_vec``.

    Spaces, reward, start, end and info are :class:`~bilateral_rl.envs.arm_env.ArmEnv`'s. Autoreset is same-step: where
    a trial ends, the observation is the next trial's, ``infos["final_obs"]`` holds the last one and
    ``infos["final_info"]`` the trial's measures.

    Args:
        num_envs: number of arms.
        task, render_mode, **settings: as for :class:`~bilateral_rl.envs.arm_env.ArmEnv`.
        device: ``"cpu"`` or a CUDA device.
    """

    metadata: dict[str, Any] = ArmEnv.metadata | {"autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        task: str | Task = "random_reach",
        render_mode: str | None = None,
        device: str = "cpu",
        **settings: Any,
    ) -> None:
        self._venv = ArmVecEnv(num_envs, task, render_mode, device, **settings)
        self.metadata = self.metadata | {"render_fps": self._venv.metadata["render_fps"]}
        self.num_envs = num_envs
        self.render_mode = render_mode
        self.single_observation_space = self._venv.observation_space
        self.single_action_space = self._venv.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32, dict[str, Any]]:
        """Start a new trial on every arm; arm i from ``seed + i``, or from the i-th of a list of seeds.

        Raises:
            ValueError: options, or a list of another length than the number of arms.
        """
        if options:
            raise ValueError(f"ArmVectorEnv starts every arm by drawing; it takes no reset options, got {options}.")
        if isinstance(seed, int):
            seed = [seed + i for i in range(self.num_envs)]
        if seed is not None:
            if len(seed) != self.num_envs:
                raise ValueError(f"{self.num_envs} arms need {self.num_envs} seeds, got {len(seed)}.")
            self._venv.seed_arms(seed)
        observation = self._venv.reset()
        assert isinstance(observation, np.ndarray)
        return observation, {}

    def step(self, actions: Float32) -> tuple[Float32, Float32, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        self._venv.step_async(actions)
        observation, reward, done, final_infos = self._venv.step_wait()
        assert isinstance(observation, np.ndarray)
        batch = self._venv.batch
        infos: dict[str, Any] = {
            "vector_reward": self._venv.last_vector_reward,
            "_vector_reward": np.ones(self.num_envs, dtype=np.bool_),
            # Where a trial just ended the clock is 0, and entry -1 is that trial's last.
            "distance": batch.distance[np.arange(self.num_envs), batch.clock - 1].astype(float),
            "_distance": np.ones(self.num_envs, dtype=np.bool_),
        }
        for arm in np.flatnonzero(done):
            final_info = final_infos[arm]
            final_obs = final_info.pop("terminal_observation")
            final_info.pop("TimeLimit.truncated")
            final_info.pop("episode")
            final_info["vector_reward"] = infos["vector_reward"][arm]
            final_info["distance"] = infos["distance"][arm]
            infos = self._add_info(infos, {"final_obs": final_obs, "final_info": final_info}, int(arm))
        return observation, reward, np.zeros(self.num_envs, dtype=np.bool_), done, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return one (480, 480, 3) RGB picture an arm, of the first few, in mode "rgb_array"."""
        return tuple(self._venv.get_images()) if self.render_mode == "rgb_array" else None  # type: ignore[arg-type]

    def close_extras(self, **kwargs: Any) -> None:
        self._venv.close()
