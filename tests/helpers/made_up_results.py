"""Long tables of made-up results, in which every group has exactly the mean and the spread that are asked for."""

from statistics import NormalDist

import numpy as np
import pandas as pd
from treatments import treated

from bilateral_rl.analysis.results import COLUMNS

METRICS = {
    "completion": ("random_reach", "goal_completion_5cm"),
    "speed": ("random_reach", "speed_to_goal_5cm"),
    "time": ("random_reach", "time_to_goal_5cm"),
    "hold": ("hold_position", "time_in_goal_5cm"),
}
# Intact models that bear out every claim of the paper.
INTACT = {
    "uni_b": {"completion": 95.5, "speed": 2.1, "hold": 22},
    "uni_dl": {"completion": 96.7, "speed": 2.34, "hold": 20},
    "uni_ndl": {"completion": 94.6, "speed": 2.0, "hold": 30},
    "bi_ns": {"completion": 96.0, "speed": 2.32, "hold": 26},
    "bi_s": {"completion": 99.0, "speed": 2.3, "hold": 27},
    "cc_ns": {"completion": 96.5, "speed": 2.7, "hold": 28},
    "cc_s": {"completion": 96.3, "speed": 2.4, "hold": 36},
}
# What is left after a lesion and the epoch of retraining: completion of reaches, and time in the goal of holds.
LESIONED = {
    "bi_s": {"deep_non_dominant": (90, 10), "deep_dominant": (60, 25)},
    "bi_ns": {"deep_non_dominant": (75, 17), "deep_dominant": (75, 17)},
    "cc_s": {
        "deep_non_dominant": (80, 12),
        "deep_dominant": (60, 22),
        "shallow_non_dominant": (50, 8),
        "shallow_dominant": (40, 12),
        "callosum": (95.8, 13),
    },
    "cc_ns": {
        "deep_non_dominant": (70, 18),
        "deep_dominant": (70, 18),
        "shallow_non_dominant": (45, 12),
        "shallow_dominant": (45, 12),
        "callosum": (96, 13),
    },
}


def _means():
    means = {(model, name, "intact"): value for model, values in INTACT.items() for name, value in values.items()}
    for model, lesions in LESIONED.items():
        for lesion, values in lesions.items():
            means |= {(model, name, lesion): value for name, value in zip(("completion", "hold"), values, strict=True)}
    return means


def standard_noise(n, rng):
    """(n,): of mean 0 and sample standard deviation 1, in random order."""
    if n == 1:
        return np.zeros(1)
    values = np.array([NormalDist().inv_cdf((i + 0.5) / n) for i in range(n)])
    return rng.permutation(values / values.std(ddof=1))


def make_results(changes=None, noise=0.004, seeds=10, without=(), protocol="output"):
    """Results in which every group has its mean, or that in ``changes``, and ``noise`` times it as spread.

    ``changes`` go by (model, name of the measure, lesion), networks that did not follow ``protocol`` have half the
    performance after a lesion, and the models in ``without`` were never trained.
    """
    rng = np.random.default_rng(0)
    rows = []
    for (model, name, lesion), mean in (_means() | (changes or {})).items():
        task, metric = METRICS[name]
        states = {"none": 1.0} if lesion == "intact" else {protocol: 1.0, "none": 0.5}
        for followed, share in states.items():
            values = share * mean * (1 + noise * standard_noise(seeds, rng))
            rows += [
                (model, task, "bptt", seed, lesion, *treated(followed), metric, v) for seed, v in enumerate(values)
            ]
    table = pd.DataFrame(rows, columns=list(COLUMNS))
    return table[~table["model"].isin(without)].reset_index(drop=True)
