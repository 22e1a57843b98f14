"""The Gymnasium face: one trial at a time, of one arm or two."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from bilateral_rl.envs.arm.parameters import N_MUSCLES, ArmParameters
from bilateral_rl.envs.doors import checked_seed, numbers, settings_for
from bilateral_rl.envs.infos import final_infos, hands_that_hold
from bilateral_rl.envs.refusals import shown
from bilateral_rl.envs.running_arms import RunningArms
from bilateral_rl.envs.scene import RENDER_MODES, SceneView, render_fps
from bilateral_rl.envs.task import PLACES, Trials
from bilateral_rl.envs.tasks import TaskLike, make_task
from bilateral_rl.envs.trial_checks import checked_trials
from bilateral_rl.envs.trials import TrialBatch

_ARM = np.zeros(1, dtype=np.int32)


class ArmEnv(RunningArms, gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A planar arm with two joints and six muscles reaches for a target, or holds its hand on one against a load.

    In experiments there may also be a cue to go, a target that jumps, fields of forces, pulses and channels. In tasks
    of two arms there are two of it, whose hands a spring may join.

    The arm is MotorNet's ``RigidTendonArm26`` with Hill muscles, as in paper section 2; a step is 10 ms.

    ## Action space: Box(-1, 1, (6,), float32)

    | index | muscle | crosses | moves |
    |---|---|---|---|
    | 0 | pectoralis | shoulder | flexes |
    | 1 | deltoid | shoulder | extends |
    | 2 | brachioradialis | elbow | flexes |
    | 3 | triceps lateral | elbow | extends |
    | 4 | biceps | both | flexes |
    | 5 | triceps long | both | extends |

    An action a commands the excitation (a + 1) / 2 in [0, 1]; values outside [-1, 1] act as the nearest bound.

    ## Observation space: Box((16,), float32)

    | index | quantity | unit | bounds |
    |---|---|---|---|
    | 0–5 | muscle length | optimal lengths | 0, 3 |
    | 6–11 | muscle velocity (lengthening positive) | maximal velocities | −5, 5 |
    | 12–13 | hand x, y | m | ± reach (0.642) |
    | 14–15 | target x, y | m | ± reach (0.642) |

    Lengths and velocities are those of the geometry one step ago, the hand's position is present: the delay that the
    paper's loop itself has. ``feedback_delay`` delays all fourteen sensed numbers further, ``proprioception_delay`` the
    muscles' and ``vision_delay`` the hand's by a number of their own; noise, likewise, is common or a sense's own. The
    target is seen at once: it is where the hand started before the cue, the goal from the cue on, and where it jumped
    to from the jump on.

    ## Reward

    The negative of the paper's loss terms of the step (section 4), with e the hand's error after the step (m), from the
    target that was seen before it, and u the commanded excitations:

    - dominant: −(5 · 10 mean(e²) + 2 · mean(u²))
    - non-dominant: −5 · mean|e|

    ``losses`` sets the weights of these terms and of three more, for either side: the squared speed of the hand, and
    the mean squares of changes of u and of muscle forces; with ``last_steps``, e and the speed count at the end alone.
    ``info["vector_reward"]`` is the pair; the reward is its mean, which is minus the combined loss. The weight penalty
    is a loss on parameters, not a reward.

    ## Two arms

    Action ``Box(-1, 1, (12,), float32)``: the dominant (right) arm's six muscles, then the non-dominant arm's.
    Observation ``Box((40,), float32)``: what the dominant arm sees, then, from index 20 on, what the other one sees:

    | index | quantity | unit | bounds |
    |---|---|---|---|
    | 0–11 | muscle lengths and velocities, as of one arm | | |
    | 12–13 | own hand x, y | m | ± reach |
    | 14–15 | other hand x, y | m | −(0.36 + reach), reach − 0.36; ± reach |
    | 16–17 | own target x, y | m | ± reach |
    | 18–19 | other target x, y | m | those of the other hand |

    Each arm sees in its own frame: its shoulder is at the origin, and x points away from the midline, so that the
    non-dominant arm is the dominant one in a mirror. The other hand is seen with the noise and the delay with which its
    own arm senses it. Rewards have the same formulas, where means are over both arms, too.

    A spring and a damper act on either hand with k (d − d₀) + c ḋ, d the vector to the other hand, d₀ its value at the
    start; with ``kind="distance"`` they act on its length alone. Hands do not collide.

    ## Start

    ``random_reach``: rest at a posture uniform over the joint range (shoulder 0–135°, elbow 0–155°); the target is
    the hand position of a second such posture; no load. ``hold_position``: rest on the target at such a posture; a
    constant load on the hand, each axis uniform in ±``max_load`` or, with ``load="direction"``, of a uniform direction
    and a size uniform from 0 to ``max_load``. Muscles start at activation 0.001.

    ``two_reaches`` and ``two_holds`` are the same for each of two arms. ``reach_and_hold``: each hand starts on its own
    side of the midline, 5 cm or farther from it, and at least 10 cm in front of the shoulders, at a posture uniform
    over those; one hand's target lies 10 to 20 cm away, in one of 72 directions that its arm can follow, the other's is
    where it starts; the spring has 50 N/m.

    ``reset(options={"start": (2,), "goal": (2,), "load": (2,)})`` sets the trial instead: angles in rad of the start
    posture and of the posture whose hand position is the target (default: the start), and a load in N (default: 0). A
    timeline and forces are drawn as ever. Of two arms each is (2, 2), the dominant arm first: angles are each arm's
    own, loads are in the frame of the body, whose x points to the right, the dominant side.

    ## End

    Truncation after ``trial_length`` steps; never termination.

    ## Info

    ``vector_reward`` (2,) and ``distance`` to the target (m) at every step; at the trial's last step also
    ``vector_return`` (2,), ``is_success``, ``speed_to_goal`` (m/step, NaN if not reached), ``time_in_goal`` (steps)
    and ``final_error`` (m), as defined in ``envs/measures.py``. Success of a hand that reaches is goal completion, that
    of a hand that holds, whose goal is its start, to be within the threshold after the last step. They count from the
    onset of the last target; without a cue, success is to stay. ``env.batch.force`` is the force on the hand in the
    last step.

    Of two arms distance and measures are (2,), the dominant hand first, and success is that of both hands;
    ``goal_completion`` (2,) is among them, and means nothing for a hand that holds, which starts in its goal.
    ``holds`` (2,) bool says which hands are to hold, because their goal is their start, where the others reach: in the
    info of ``reset``, and at the last step again.

    Args:
        task: ``"random_reach"``, ``"hold_position"``, of two arms ``"two_reaches"``, ``"reach_and_hold"`` or
            ``"two_holds"``, the name or YAML file of an experiment, or a :class:`~bilateral_rl.envs.tasks.Task`.
        render_mode: None, ``"rgb_array"`` or ``"human"``; at ``metadata["render_fps"]`` pictures a second the arm moves
            four times slower than it does.
        **settings: fields of :class:`~bilateral_rl.envs.settings.TrialSettings`: ``trial_length=50`` (steps),
            ``threshold=0.05`` (m), ``max_load=10.0`` (N), ``load="axes"`` or ``"direction"``,
            ``sensory_noise=0.0``, ``motor_noise=0.0``, ``feedback_delay=0`` (steps), ``length_noise``,
            ``velocity_noise``, ``vision_noise``, ``proprioception_delay``, ``vision_delay`` (None: the common ones),
            ``losses=LossSettings()``, ``two_arms=TwoArmSettings()`` (tasks of two arms alone), ``arm=ArmParameters()``.

    Raises:
        ValueError: an unknown task, render mode or setting, or a setting outside its range.

    ## Version history

    - v0: first release.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": render_fps(ArmParameters.timestep)}

    def __init__(self, task: TaskLike = "random_reach", render_mode: str | None = None, **settings: Any) -> None:
        task = make_task(task)
        self.batch = TrialBatch(task, settings_for(task, settings), n=1)
        self.settings = self.batch.settings
        self.metadata = self.metadata | {"render_fps": render_fps(self.settings.arm.timestep)}
        low, high = self.settings.observation_bounds(task.n_arms)
        self.observation_space = spaces.Box(low, high)
        self.action_space = spaces.Box(-1.0, 1.0, (task.n_arms * N_MUSCLES,))
        self._view = SceneView(self.batch, render_mode)
        self.render_mode = render_mode
        self._holds: NDArray[np.bool_] | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        places = _places_from_options({} if options is None else options, self.batch.n_arms)
        super().reset(seed=checked_seed(seed))
        draws = self.batch.draw(self.np_random)
        trials = self._next_trial(places, draws.uniform)
        self.batch.start(_ARM, trials, draws.noise)
        self._view.advance()
        info: dict[str, Any] = {}
        if self.batch.n_arms == 2:
            self._holds = hands_that_hold(trials).reshape(1, 2)
            info["holds"] = self._holds[0].copy()
        return self.batch.observation[0].copy(), info

    def _next_trial(self, places: Trials | None, uniform: NDArray[np.float64]) -> Trials:
        """Return the trial that is drawn, but at ``places`` if they are given."""
        task = self.batch.task
        if places is not None and not (task.has_timeline or task.has_forces or task.n_arms > 1):
            return places
        drawn = task.trials(uniform, self.settings)
        if places is None:
            return drawn
        checked_trials(drawn, 1, task, self.settings)
        return Trials(*places[:3], *Trials(*drawn)[3:])

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        batch = self.batch
        batch.step(action)
        clock = int(batch.clock[0])
        truncated = clock == self.settings.trial_length
        info: dict[str, Any] = {
            "vector_reward": batch.vector_reward[0].copy(),
            "distance": float(batch.distance[0, clock - 1])
            if batch.n_arms == 1
            else batch.distance[:, clock - 1].astype(float),
        }
        if truncated:
            info |= final_infos(batch, _ARM, self._holds)[0]
        self._view.advance()
        return batch.observation[0].copy(), float(batch.reward[0]), False, truncated, info

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """Return the present picture (480, 480, 3) in mode "rgb_array"; in mode "human" each step shows it itself."""
        return self._view.render()

    def close(self) -> None:
        self._view.close()


def make_arm_env(**settings: Any) -> ArmEnv:
    """Return an :class:`ArmEnv` for ``gymnasium.make``, whose ``max_episode_steps`` is its ``trial_length``.

    Gymnasium puts a ``TimeLimit`` around an environment and does not tell it: trials would end at the sooner of two
    limits, and without their measures where that is Gymnasium's. So the limit is looked up where ``make`` has it.

    Raises:
        ValueError: a ``trial_length`` besides that is another one.
    """
    making = sys._getframe(1).f_locals
    limit = making.get("max_episode_steps") or getattr(making.get("env_spec"), "max_episode_steps", None)
    return ArmEnv(**with_time_limit(settings, limit))


make_arm_env.metadata = ArmEnv.metadata  # type: ignore[attr-defined]  # where Gymnasium looks for it


def with_time_limit(settings: dict[str, Any], max_episode_steps: int | None) -> dict[str, Any]:
    """Return ``settings`` with Gymnasium's limit, if there is one (-1: none), as ``trial_length``.

    Raises:
        ValueError: they have another ``trial_length``.
    """
    if max_episode_steps in (None, -1):
        return settings
    if settings.get("trial_length", max_episode_steps) != max_episode_steps:
        raise ValueError(
            f"max_episode_steps={max_episode_steps} and trial_length={settings['trial_length']} contradict each other: "
            "give trial_length alone."
        )
    return settings | {"trial_length": max_episode_steps}


def _places_from_options(options: dict[str, Any], n_arms: int) -> Trials | None:
    """Return the start, goal and load that ``reset(options=...)`` describes; None without options.

    Raises:
        TypeError: no dictionary, or values that are no numbers.
        ValueError: another option, no start, or values that are not two numbers for each arm.
    """
    if not isinstance(options, Mapping):
        raise TypeError(f"options must be a dictionary, got {type(options).__name__}.")
    if not options:
        return None
    if "start" not in options or set(options) - set(PLACES):
        given = ", ".join(map(str, options))
        raise ValueError(f"options takes start, goal and load; start is required, got {given}.")
    values = {name: numbers(name, value) for name, value in options.items()}
    shape, words = ((2,), "two finite numbers") if n_arms == 1 else ((2, 2), "two finite numbers for each of two arms")
    for name, value in values.items():
        if value.shape != shape or not np.isfinite(value).all():
            raise ValueError(f"{name} must be {words}, got {shown(options[name])}.")
    start, no_load = values["start"], np.zeros(shape, dtype=np.float32)
    return Trials(start=start, goal=values.get("goal", start), load=values.get("load", no_load))
