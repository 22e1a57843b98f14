"""What sets trials apart, and what a task is: a distribution of trials."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bilateral_rl.envs.settings import TrialSettings

Float32 = NDArray[np.float32]


NEVER = 1_000_000
"""A step that no trial comes to: of a cue that does not come, or a target that does not jump."""


class Timeline(NamedTuple):
    """When the targets of ``n`` trials change; steps count from 0, and one is judged by the target seen before it."""

    go: NDArray[np.int32]
    """(n,): step from which on the goal is the target; until then it is the hand's position at the start. 0: at once;
    ``NEVER``: no cue comes."""
    jump: NDArray[np.int32]
    """(n,): step, of at least ``go``, from which on the target is ``jump_goal``; ``NEVER``: it does not jump."""
    jump_goal: Float32
    """(n, 2): angles (rad) whose hand position the target jumps to."""


class HandForces(NamedTuple):
    """Forces on the hands of ``n`` trials beside the load: B v + K (x₀ − x), a pulse, and the walls of a channel."""

    velocity_gain: Float32
    """(n, 2, 2): B, force by velocity of the hand (N·s/m)."""
    position_gain: Float32
    """(n, 2, 2): K, force by distance from ``center`` (N/m)."""
    center: Float32
    """(n, 2): x₀, where the elastic field has no force (m)."""
    pulse: Float32
    """(n, 2): force (N) in the steps from the first of ``pulse_window`` on and before its second."""
    pulse_window: NDArray[np.int32]
    """(n, 2): first step of the pulse, and first step after it; counted from the start of the trial."""
    walls: Float32
    """(n, 2): stiffness (N/m) and damping (N·s/m) of the walls along the line through start and goal; 0: none."""


class Spring(NamedTuple):
    """What ties the two hands of ``n`` trials together, as :class:`~bilateral_rl.envs.two_arms.SpringSettings` say."""

    stiffness: Float32
    """(n,) (N/m)."""
    damping: Float32
    """(n,) (N·s/m)."""


class Trials(NamedTuple):
    """What sets ``n`` trials apart.

    In a task of two arms every field but ``spring`` has the arms on a second axis, (n, 2, …), the dominant one first:
    angles are each arm's own, which mirror each other; forces and positions are in the frame of the body.
    """

    start: Float32
    """(n, 2): shoulder and elbow angle at the start (rad); the arm is at rest."""
    goal: Float32
    """(n, 2): angles (rad) whose hand position is the target."""
    load: Float32
    """(n, 2): constant force on the hand (N)."""
    timeline: Timeline | None = None
    """When targets change; None in a task without a timeline, whose targets are there from the start."""
    forces: HandForces | None = None
    """Further forces on the hand; None in a task without such."""
    spring: Spring | None = None
    """What ties the hands together; None in a task of one arm."""


FEATURES = ("cue", "jump", "field", "pulse", "channel")
"""What the trials of a task may have: a go cue that comes later than the start, a target that jumps, a field of forces,
a pulse, and a channel."""

PLACES = Trials._fields[:3]
"""The fields that every trial has: start, goal and load."""


class Task(ABC):
    """A distribution of trials; subclass it for a task of your own.

    Attributes:
        id: name in commands and run folders.
        n_arms: 1, or 2 for tasks of both arms.
        n_uniform: uniform numbers that one trial takes.
        has_load: whether its trials draw a load, as ``settings.load`` and ``settings.max_load`` say.
        has_timeline: whether its trials have a :class:`Timeline`.
        has_forces: whether its trials have :class:`HandForces`.
        has_roles: whether one of its two hands reaches and the other one holds, as ``settings.two_arms`` says.
        judged_by: the measure that says how well it is done, "goal_completion" or "time_in_goal".
        description: what the arm is to do, for lists.
        trial: settings of trials that it has where nobody says otherwise, by name.
    """

    id: str
    n_arms: Literal[1, 2] = 1
    n_uniform: int = 4
    has_load: bool = True
    has_timeline: bool = False
    has_forces: bool = False
    has_roles: bool = False
    judged_by: Literal["goal_completion", "time_in_goal"] = "goal_completion"
    description: str = ""
    trial: Mapping[str, Any] = {}

    @abstractmethod
    def trials(self, uniform: NDArray[np.float64], settings: TrialSettings) -> Trials:
        """Draw ``n`` trials.

        Args:
            uniform: (n, n_uniform) random numbers in [0, 1).
            settings: how trials run: joint limits, and the largest load.

        Returns:
            The trials, whose fields are arrays (n, 2) or lists, or one row where all trials have the same; of two arms
            (n, 2, 2), as :class:`Trials` says. Postures lie within the joint limits; anything else is refused when the
            trials begin.
        """

    def check(self, settings: TrialSettings) -> None:
        """Raise a ValueError for settings that its trials cannot run with; by itself, a task has none such."""
        return

    def is_symmetric(self, settings: TrialSettings) -> bool:
        """Return whether a trial is as likely as the same one with both arms exchanged, each doing what the other did.

        Tests then do every trial both ways, so that no hand has the easier ones; a task of two arms that is so may say
        so, with all fields of its trials as arrays (n, 2, …).
        """
        return False

    @property
    def roles(self) -> frozenset[str]:
        """What hands do in its trials, "reach", "hold", or both."""
        of_all = "hold" if self.judged_by == "time_in_goal" else "reach"
        return frozenset({"reach", "hold"} if self.has_roles else {of_all})

    @property
    def features(self) -> frozenset[str]:
        """Which of :data:`FEATURES` some of its trials may have, which says what can be measured in them."""
        of_timeline = ("cue", "jump") if self.has_timeline else ()
        return frozenset((*of_timeline, *(("field", "pulse", "channel") if self.has_forces else ())))

    @property
    def mixes(self) -> tuple[str, ...]:
        """The conditions of its trials that differ in the forces on the hand, "field", "null" and "channel"; empty
        where all trials are alike.
        """
        return ()

    def target_indices(self, uniform: NDArray[np.float64], settings: TrialSettings) -> NDArray[np.int32]:
        """Return which of the targets that it lists each trial of :meth:`trials` has, from 0; -1: no list.

        (n,) of one arm; (n, 2) of two arms, whose lists are numbered through, that of the dominant arm first.
        """
        n = len(uniform)
        return np.full(n if self.n_arms == 1 else (n, self.n_arms), -1, dtype=np.int32)

    def field(self, uniform: NDArray[np.float64], settings: TrialSettings) -> HandForces | None:
        """Return the forces of the trials as if the field were on in each of them, in place of any channel.

        That is what a channel's force is measured against, and what catch trials lack.
        """
        return self.trials(uniform, settings).forces
