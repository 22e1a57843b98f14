"""The view of a batch of arms that every environment renders."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.arm.physics import ACTIVATION
from bilateral_rl.envs.arm_drawing import ArmScene, CueScene, Role
from bilateral_rl.envs.canvas import Window, tile
from bilateral_rl.envs.force_drawing import HandForceScene
from bilateral_rl.envs.rendering import Scene, draw
from bilateral_rl.envs.spring_drawing import SpringScene
from bilateral_rl.envs.spring_forces import forces_of_springs
from bilateral_rl.envs.trials import TrialBatch

RENDER_MODES = ("rgb_array", "human")
SLOW_DOWN = 4
"""Seconds for which pictures show a second of the arm's: a reach takes half a second, too short to follow."""
MAX_DRAWN = 16
"""Trials drawn of a larger batch: enough to see, and a picture takes milliseconds an arm."""

Picture = NDArray[np.uint8]


def render_fps(timestep: float) -> int | float:
    """Return how many pictures a second show the arm :data:`SLOW_DOWN` times slower than it is, a picture a step.

    Args:
        timestep: the length of a step (s).
    """
    fps = round(1 / (SLOW_DOWN * timestep), 6)  # 25, not 25.000000000000004
    return int(fps) if fps.is_integer() else fps


class SceneView:
    """Follows the first trials of a batch: keeps their hand paths, draws them, and shows them if the mode is "human".

    Args:
        batch: the arms.
        render_mode: None, ``"rgb_array"`` or ``"human"``.
        most: trials drawn of a larger batch.

    Raises:
        ValueError: another mode.
    """

    def __init__(self, batch: TrialBatch, render_mode: str | None, most: int = MAX_DRAWN) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise ValueError(f"unknown render_mode {render_mode!r}; choose from None, {', '.join(RENDER_MODES)}.")
        self._batch, self._mode, self._n_arms = batch, render_mode, batch.task.n_arms
        self._paths: list[list[NDArray[np.float32]]] = [[] for _ in range(min(batch.n, most))]
        """By trial, positions of its hands, (n_arms, 2) each."""
        self._springs = [np.zeros((batch.n * self._n_arms, 2), np.float32)] * 2
        """Forces of the springs on the hands, in the last step and now."""
        self._window: Window | None = None

    def advance(self) -> None:
        """Take note that the arms moved or started anew; in mode "human", show them."""
        if self._mode is None:
            return
        hands = self._batch.hand.reshape(self._batch.n, -1, 2)
        for path, hand, clock in zip(self._paths, hands, self._batch.clock, strict=False):
            if clock == 0:
                path.clear()
            path.append(hand.copy())
        if self._n_arms > 1:
            self._springs = [self._springs[1], forces_of_springs(self._batch)]
        if self._mode == "human":
            self._show()

    def render(self) -> Picture | None:
        """Return the picture, trials side by side, in mode "rgb_array"; else None."""
        return tile(self.pictures()) if self._mode == "rgb_array" else None

    def pictures(self) -> list[Picture]:
        """Return one RGB picture (h, w, 3) a trial, 480 high."""
        return [self._picture(trial) for trial in range(len(self._paths))]

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def _picture(self, trial: int) -> Picture:
        settings = self._batch.settings
        arms = tuple(self._arm(trial, arm) for arm in range(self._n_arms))
        distance = settings.two_arms.shoulder_distance
        return draw(settings.arm, Scene(arms, settings.threshold, "", distance, self._spring(trial)))

    def _arm(self, trial: int, arm: int) -> ArmScene:
        batch, row = self._batch, trial * self._n_arms + arm
        path = np.reshape(self._paths[trial], (-1, self._n_arms, 2))[:, arm]
        return ArmScene(
            angles=batch.joint[row, :2],
            activation=batch.muscle[row, ACTIVATION],
            target=batch.target[row],
            path=path,
            load=batch.load[row],
            forces=self._forces(row),
            cue=self._cue(trial, row),
            role=self._role(row, path) if self._n_arms > 1 else None,
        )

    def _role(self, row: int, path: NDArray[np.float32]) -> Role:
        batch = self._batch
        goal = batch.state_array("goal_target")[row] if batch.task.has_timeline else batch.target[row]
        return "hold" if len(path) and np.array_equal(goal, path[0]) else "reach"

    def _spring(self, trial: int) -> SpringScene | None:
        """Return the spring between the hands, if there is one."""
        if self._n_arms == 1 or not any(self._batch.state_array(name)[trial] for name in ("stiffness", "damping")):
            return None
        start_length = float(np.linalg.norm(self._batch.state_array("rest")[trial]))
        return SpringScene(start_length, self._springs[1][self._n_arms * trial])

    def _forces(self, row: int) -> HandForceScene | None:
        batch = self._batch
        if not batch.task.has_forces:
            return None
        return HandForceScene(
            force=batch.force[row] - batch.load[row] - self._springs[0][row],
            **{name: batch.state_array(name)[row] for name in ("offset", "velocity_gain", "position_gain")},
        )

    def _cue(self, trial: int, row: int) -> CueScene | None:
        batch = self._batch
        if not batch.task.has_timeline:
            return None
        go, jump = (int(batch.state_array(name)[row]) for name in ("go", "jump"))
        return CueScene.at(int(batch.clock[trial]), go, jump, batch.state_array("goal_target")[row])

    def _show(self) -> None:
        if self._window is None:
            task, timestep = self._batch.task, self._batch.settings.arm.timestep
            name = getattr(task, "id", type(task).__name__)
            self._window = Window(f"bilateral_rl · {name}", render_fps(timestep))
        self._window.show(tile(self.pictures()))

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_window": None}
