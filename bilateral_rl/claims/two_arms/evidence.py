"""The results that B1 to B6 ask for: values by seed of a hand in a role, of networks in a state, by the spring."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import pandas as pd

from bilateral_rl.analysis.floor import is_above
from bilateral_rl.analysis.metric import Better, Metric, Role
from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.analysis.results import State, by_seed
from bilateral_rl.claims.evidence import Measure, Sample
from bilateral_rl.claims.two_arms.criteria import HandCriteria
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.envs.tasks import make_task
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import INTACT, lesion_words
from bilateral_rl.vocabulary import SIDES, Side

TASK = "reach_and_hold"
"""The task that the claims are about."""
NOT_LEARNED = 50.0
"""Share of reaches (%) that the intact network completes within 5 cm below which, with either hand, it counts as not
having learned: it stays on the plateau of keeping both hands where they are, or still flings them about [ours]."""
OTHER: dict[Side, Side] = {SIDES[0]: SIDES[1], SIDES[1]: SIDES[0]}
"""The other hand, or the other hemisphere."""
UNSTEADY = 5.0
"""RMS error of holds (cm) above which, with either hand, a network counts as not having learned to hold [ours]."""
NONE = Protocol("none").name
_LEARNED: dict[Role, str] = {"reach": "goal_completion_5cm", "hold": "hold_rms_error"}
"""What tells whether a network learned, by role."""
_STATE = ("metric", "task", "model", "lesion", "protocol", "network")
"""Columns that together name a sample."""


class HandEvidence:
    """Results as B1 to B6 ask for them.

    Networks that never learned the task are left out of every sample: a hand that stays where it is moves straight and
    holds well, and one that flies about says nothing of either. :meth:`left_out` names them.

    Args:
        results: long tables (:mod:`bilateral_rl.analysis.results`) of one algorithm by the stiffness of the spring in
            the tests (N/m); one that is missing leaves undecided what needs it.
        criteria: what they are judged by.
        task: of the trials.
        models: that were to be trained, so that what is missing can be told from what was never asked for.

    Raises:
        UserError: results of several algorithms.
    """

    def __init__(
        self,
        results: Mapping[float, pd.DataFrame],
        criteria: HandCriteria,
        task: str = TASK,
        models: Sequence[str] = tuple(MODELS),
    ) -> None:
        algorithms = sorted({algo for table in results.values() for algo in set(table["algo"])})
        if len(algorithms) > 1:
            raise UserError(f"Claims are tested on results of one algorithm, not of {' and '.join(algorithms)}.")
        self._results, self.criteria, self.task = dict(results), criteria, task
        self._rows = {spring: table.groupby(list(_STATE)).indices for spring, table in results.items()}
        self._models = tuple(models)
        self._not_learned: dict[str, list[int]] = {}

    def in_task(self, task: str) -> HandEvidence:
        """Return the same of another task, whose networks are others and know no spring."""
        return HandEvidence(self._results, replace(self.criteria, spring=0.0), task, self._models)

    def hand(
        self,
        measure: str,
        model: str,
        hand: Side,
        role: Role,
        *,
        spring: float | None = None,
        lesion: str = INTACT,
        protocol: str = NONE,
    ) -> Sample:
        """Return a measure of one hand in one role.

        Args:
            measure: name of the metric, of either hand.
            model: name of the model.
            hand: whose.
            role: of the hand.
            spring: stiffness of the spring in the tests (N/m); None for that of the criteria.
            lesion: of the networks.
            protocol: name of what followed the lesion.
        """
        name = f"{hand.replace('_', '-')} hand of {model}"
        name += "" if lesion == INTACT else f" with {lesion_words(lesion)} lesion"
        state = State(self.task, model, lesion, protocol)
        values = self._values(metric_of_hand(measure, self.task, hand, role), state, spring)
        return Sample(name, state, Measure(find_metric(measure), self.task), values, self.absence(model))

    def loss(self, model: str, *, spring: float, lesion: str, protocol: str) -> pd.Series:
        """Return the combined loss by seed, of both arms and summed over a trial."""
        return self._loss(State(self.task, model, lesion, protocol), spring)

    def is_relearned(self, model: str, *, spring: float, lesion: str, protocol: str) -> bool:
        """Whether networks lose no less than freshly initialized ones that the same was done to; no if nobody knows."""
        state = State(self.task, model, lesion, protocol)
        states = (state, state.control, state.after(INTACT))
        table = pd.concat([self._loss(one, spring) for one in states], axis=1, join="inner")
        return is_above(*(-table.iloc[:, i] for i in range(3))) is False

    def has(self, model: str) -> bool:
        """Whether there is any result of the model in the task, whatever it is worth."""
        return any(((table["model"] == model) & (table["task"] == self.task)).any() for table in self._results.values())

    def has_results(self, spring: float) -> bool:
        """Whether there are results of tests with a spring of this stiffness (N/m)."""
        return spring in self._results

    def seeds(self, model: str) -> list[int]:
        """Return the seeds of the intact networks of which there are results, whether they learned or not."""
        values = self._raw("return_dominant", State(self.task, model), None)
        return sorted(map(int, values.index))

    def not_learned(self, model: str) -> list[int]:
        """Return the seeds whose intact network never learned the task, in rising order.

        By :data:`NOT_LEARNED`, or in a task without reaches by :data:`UNSTEADY`.
        """
        if model not in self._not_learned:
            role: Role = "reach" if "reach" in make_task(self.task).roles else "hold"
            values = [self._intact(_LEARNED[role], model, hand, role) for hand in SIDES]
            table = pd.concat(values, axis=1, join="outer")
            failed = table.min(axis=1) < NOT_LEARNED if role == "reach" else table.max(axis=1) > UNSTEADY
            self._not_learned[model] = sorted(map(int, failed.index[failed]))
        return self._not_learned[model]

    def absence(self, model: str) -> str:
        """Say why nothing can be said of a model: not asked for, or no network learned; "" if neither is so."""
        if model not in self._models:
            return f"not among the study's models: {model}"
        seeds = self.seeds(model)
        return self.left_out([model]) if seeds and self.not_learned(model) == seeds else ""

    def share_left_out(self) -> str:
        """Say in a sentence how many networks of all never learned; "" if every one did."""
        seeds = {model: self.seeds(model) for model in self._models}
        n, stuck = sum(map(len, seeds.values())), sum(len(self.not_learned(model)) for model in seeds)
        if not stuck:
            return ""
        advice = ": train longer" if stuck == n else ""
        return f"{stuck} of {n} networks complete less than {NOT_LEARNED:g} % of their reaches{advice}"

    def left_out(self, models: Sequence[str]) -> str:
        """Say in words which networks of these models never learned and are left out; "" if none."""
        parts = [
            f"{model} {', '.join(map(str, seeds))}" for model in models if (seeds := self.not_learned(model))
        ]  # fmt: skip
        return f"never learned and left out, by seed: {'; '.join(parts).replace(';', ' and')}" if parts else ""

    def _intact(self, measure: str, model: str, hand: Side, role: Role) -> pd.Series:
        return self._raw(metric_of_hand(measure, self.task, hand, role), State(self.task, model), None)

    def _loss(self, state: State, spring: float) -> pd.Series:
        """Half of both losses, of which rewards are the negative."""
        losses = [self._values(f"return_{side}", state, spring) for side in SIDES]
        return -pd.concat(losses, axis=1, join="inner").mean(axis=1, skipna=False)

    def _values(self, metric: str, state: State, spring: float | None) -> pd.Series:
        values = self._raw(metric, state, spring)
        return values[~values.index.isin(self.not_learned(state.model))]

    def _raw(self, metric: str, state: State, spring: float | None) -> pd.Series:
        spring = self.criteria.spring if spring is None else spring
        key = metric, state.task, state.model, state.lesion, state.protocol, state.network
        rows = self._rows.get(spring, {}).get(key, [])  # looked up, as tables are long and a study has many readings
        if not len(rows):
            return pd.Series(dtype="float64", index=pd.Index([], dtype="int64"))
        return by_seed(self._results[spring].iloc[rows], metric, state)


def derived(label: str, unit: str, task: str, better: Better = "lower") -> Measure:
    """Return a measure that is computed from others, and of no trials itself."""
    return Measure(Metric("derived", label, unit, (), better, label, lambda record: math.nan), task)


def metric_of_hand(measure: str, task: str, hand: Side, role: Role) -> str:
    """Return the name of a metric of one hand; its role is told where hands have either in a task."""
    return find_metric(measure).of(hand, role if make_task(task).has_roles else None).name
