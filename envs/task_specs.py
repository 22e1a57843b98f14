"""The tasks there are, as plain data that can be read without anything numerical.

:mod:`bilateral_rl.envs.tasks` holds what their trials are drawn from.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal


@dataclass(frozen=True)
class TaskSpec:
    """What everything but the arm knows of a task."""

    environment_id: str
    """Name of the environment in Gymnasium."""
    description: str
    """What the arm is to do, for lists."""
    judged_by: Literal["goal_completion", "time_in_goal"]
    """The measure that says how well it is done: the share of goals completed, or the time spent in the goal."""
    n_arms: Literal[1, 2] = 1
    """How many arms it is for."""
    trial: Mapping[str, Any] = field(default_factory=dict)
    """Settings of trials that it has where nobody says otherwise."""


TASK_SPECS: dict[str, TaskSpec] = {
    "random_reach": TaskSpec(
        "bilateral_rl/RandomReach-v0",
        "reach from one random posture to the hand position of another",
        judged_by="goal_completion",
    ),
    "hold_position": TaskSpec(
        "bilateral_rl/HoldPosition-v0",
        "keep the hand where it is against a constant load",
        judged_by="time_in_goal",
    ),
    "two_reaches": TaskSpec(
        "bilateral_rl/TwoReaches-v0",
        "reach with both hands, each from one random posture to the hand position of another",
        judged_by="goal_completion",
        n_arms=2,
    ),
    "reach_and_hold": TaskSpec(
        "bilateral_rl/ReachAndHold-v0",
        "reach with one hand while the other, tied to it by a spring, keeps its place",
        judged_by="goal_completion",
        n_arms=2,
        trial={"two_arms": {"spring": {"stiffness": 50.0}}},
    ),
    "two_holds": TaskSpec(
        "bilateral_rl/TwoHolds-v0",
        "keep both hands where they are, each against a constant load of its own",
        judged_by="time_in_goal",
        n_arms=2,
    ),
}
"""By name, as in commands and run folders: the paper's two (section 3; what it judges each by: section 7), and those of
two arms."""

PARADIGMS: dict[str, str] = {
    "center_out": "bilateral_rl/CenterOut-v0",
    "curl_field": "bilateral_rl/CurlField-v0",
    "saddle_field": "bilateral_rl/SaddleField-v0",
    "target_jump": "bilateral_rl/TargetJump-v0",
    "force_pulse": "bilateral_rl/ForcePulse-v0",
    "delayed_reach": "bilateral_rl/DelayedReach-v0",
    "bimanual_reaches": "bilateral_rl/BimanualReaches-v0",
    "bimanual_curl_field": "bilateral_rl/BimanualCurlField-v0",
}
"""The experiments that ship, ``paradigms/<name>.yaml``, by name, and their names in Gymnasium."""
EXPERIMENT_ID = "bilateral_rl/Experiment-v0"
"""Name in Gymnasium of an environment of any experiment."""
ALIASES = {"centre_out": "center_out"}
"""Other names of experiments."""
