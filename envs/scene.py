"""The view of a batch of arms that every environment renders."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.arm.physics import ACTIVATION
from bilateral_rl.envs.arm_drawing import ArmScene, CueScene
from bilateral_rl.envs.canvas import Window, tile
from bilateral_rl.envs.force_drawing import HandForceScene
from bilateral_rl.envs.rendering import Scene, draw
from bilateral_rl.envs.trials import TrialBatch

RENDER_MODES = ("rgb_array", "human")
SLOW_DOWN = 4
"""Seconds for which pictures show a second of the arm's: a reach takes half a second, too short to follow."""
MAX_DRAWN = 16
"""Arms drawn of a larger batch: enough to see, and a picture takes milliseconds an arm."""

Picture = NDArray[np.uint8]


def render_fps(timestep: float) -> int | float:
    """Return how many pictures a second show the arm :data:`SLOW_DOWN` times slower than it is, a picture a step.

    Args:
        timestep: the length of a step (s).
    """
    fps = round(1 / (SLOW_DOWN * timestep), 6)  # 25, not 25.000000000000004
    return int(fps) if fps.is_integer() else fps


class SceneView:
    """Follows the first arms of a batch: keeps their hand paths, draws them, and shows them if the mode is "human".

    Args:
        batch: the arms.
        render_mode: None, ``"rgb_array"`` or ``"human"``.
        most: arms drawn of a larger batch.

    Raises:
        ValueError: another mode.
    """

    def __init__(self, batch: TrialBatch, render_mode: str | None, most: int = MAX_DRAWN) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise ValueError(f"unknown render_mode {render_mode!r}; choose from None, {', '.join(RENDER_MODES)}.")
        self._batch, self._mode = batch, render_mode
        self._paths: list[list[NDArray[np.float32]]] = [[] for _ in range(min(batch.n, most))]
        self._window: Window | None = None

    def advance(self) -> None:
        """Take note that the arms moved or started anew; in mode "human", show them."""
        if self._mode is None:
            return
        for path, hand, clock in zip(self._paths, self._batch.hand, self._batch.clock, strict=False):
            if clock == 0:
                path.clear()
            path.append(hand.copy())
        if self._mode == "human":
            self._show()

    def render(self) -> Picture | None:
        """Return the picture, arms side by side, in mode "rgb_array"; else None."""
        return tile(self.pictures()) if self._mode == "rgb_array" else None

    def pictures(self) -> list[Picture]:
        """Return one (480, 480, 3) RGB picture an arm."""
        return [self._picture(arm) for arm in range(len(self._paths))]

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def _picture(self, arm: int) -> Picture:
        batch = self._batch
        one = ArmScene(
            angles=batch.joint[arm, :2],
            activation=batch.muscle[arm, ACTIVATION],
            target=batch.target[arm],
            path=np.array(self._paths[arm]).reshape(-1, 2),
            load=batch.load[arm],
            forces=self._forces(arm),
            cue=self._cue(arm),
        )
        return draw(batch.settings.arm, Scene((one,), batch.settings.threshold))

    def _forces(self, arm: int) -> HandForceScene | None:
        batch = self._batch
        if not batch.task.has_forces:
            return None
        return HandForceScene(
            force=batch.force[arm] - batch.load[arm],
            **{name: batch.state_array(name)[arm] for name in ("offset", "velocity_gain", "position_gain")},
        )

    def _cue(self, arm: int) -> CueScene | None:
        batch = self._batch
        if not batch.task.has_timeline:
            return None
        go, jump = (int(batch.state_array(name)[arm]) for name in ("go", "jump"))
        return CueScene.at(int(batch.clock[arm]), go, jump, batch.state_array("goal_target")[arm])

    def _show(self) -> None:
        if self._window is None:
            task, timestep = self._batch.task, self._batch.settings.arm.timestep
            name = getattr(task, "id", type(task).__name__)
            self._window = Window(f"bilateral_rl · {name}", render_fps(timestep))
        self._window.show(tile(self.pictures()))

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_window": None}
