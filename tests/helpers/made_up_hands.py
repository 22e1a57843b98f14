"""Long tables of made-up results of two arms, by spring, in which every effect has the size asked for."""

import numpy as np
import pandas as pd
from made_up_results import standard_noise
from treatments import treated

from bilateral_rl.analysis.metric import ROLES
from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.claims.two_arms.evidence import metric_of_hand
from bilateral_rl.vocabulary import SIDES

MODELS = ("bi_ns", "bi_s", "cc_ns", "cc_s")
SPRINGS = (50.0, 0.0)
STRAIGHT = ("perpendicular_deviation_until_2cm", "perpendicular_deviation", "initial_direction_error_until_2cm",
            "initial_direction_error", "path_length_ratio_until_2cm", "path_length_ratio")  # fmt: skip
USUAL = {"extent": 95, "goal_completion_3cm": 85, "goal_completion_5cm": 96, "final_error": 2, "hold_rms_error": 2,
         "hold_drift": 2, "time_in_goal_1cm": 15, "time_in_goal_2cm": 30, "time_in_goal_5cm": 48,
         **dict.fromkeys(STRAIGHT, 4)}  # fmt: skip
"""Of every hand without an effect."""
_IN_THE_NOISE = 0.002


class World:
    """What is true of the made-up networks; by default the claims, each by a fifth of the mean.

    Attributes:
        straighter: by which share of the mean the dominant hand of a model reaches straighter.
        steadier: by which share of the mean the non-dominant hand of a model holds more stably.
        harm: combined loss without callosum over intact, by spring.
        deficits: by (model, lesioned side, measure), what the ipsilesional arm's measure is multiplied by.
        stuck: seeds of a model that stayed on the plateau.
    """

    def __init__(self):
        specialized = {"bi_s": 0.2, "cc_s": 0.2}
        self.straighter, self.steadier = dict(specialized), dict(specialized)
        self.harm = {50.0: 1.5, 0.0: 1.2}
        self.deficits = {
            (model, side, name): 1.3
            for model in MODELS
            for side, names in (("dominant", STRAIGHT), ("non_dominant", ("final_error",)))
            for name in names
        }
        self.stuck, self.without, self.noise, self.seeds = {}, (), _IN_THE_NOISE, 10
        self.tasks, self.retrained = ("reach_and_hold",), "output"

    def results(self):
        """The tables by spring."""
        rng = np.random.default_rng(0)
        return {spring: self._table(spring, rng) for spring in SPRINGS}

    def _table(self, spring, rng):
        rows, noise = [], standard_noise(self.seeds, rng)
        for task in self.tasks:
            for model in (m for m in MODELS if m not in self.without):
                for lesion, protocol in _states(model, self.retrained):
                    treatment = treated(protocol)
                    for name, mean in self._means(task, model, lesion, spring).items():
                        values = mean * (1 + self.noise * rng.permutation(noise))
                        for seed in self.stuck.get(model, ()):
                            values[seed] = _stuck(name, values[seed])
                        rows += [(model, task, "bptt", seed, lesion, *treatment, name, value)
                                 for seed, value in enumerate(values)]  # fmt: skip
        return pd.DataFrame(rows, columns=list(COLUMNS))

    def _means(self, task, model, lesion, spring):
        """By the name of the metric."""
        loss = self.harm[spring] if lesion == "callosum" else 1.0
        means = {"return_dominant": -1.5 * loss, "return_non_dominant": -0.5 * loss}
        for name in USUAL:
            needed = find_metric(name).part.role
            for role in ROLES if needed is None else (needed,):
                for hand in SIDES:
                    means[metric_of_hand(name, task, hand, role)] = self._mean(model, lesion, name, hand, role)
        return means

    def _mean(self, model, lesion, name, hand, role):
        mean, sign = USUAL[name], 1 if hand == "non_dominant" else -1
        if name in STRAIGHT:
            mean *= 1 + sign * self.straighter.get(model, 0) / 2
        if role == "hold":
            up = 1 if find_metric(name).better == "lower" else -1
            mean *= 1 - sign * up * self.steadier.get(model, 0) / 2
        side = lesion.removeprefix("deep_")
        if side in SIDES and role == "reach":
            if side == hand:
                return 0.3 * mean  # undriven
            mean *= self.deficits.get((model, side, name), 1.0)
        return mean


def _states(model, retrained):
    lesions = ["intact", "deep_dominant", "deep_non_dominant", *(["callosum"] if model.startswith("cc") else [])]
    return [(lesion, protocol) for lesion in lesions for protocol in ("none", retrained)]


def _stuck(name, value):
    """A hand that stays where it is moves straight and holds perfectly."""
    if "extent" in name or "completion" in name:
        return 3.0
    return 0.1 if "deviation" in name or "rms" in name else value
