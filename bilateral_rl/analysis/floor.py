"""At the floor: networks that do no better than freshly initialized ones that went through the same.

What such networks do after a lesion shows what a protocol teaches anybody, and not what was kept; nor do the sides of
a network at the floor say anything about its specialization.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.analysis.results import State, by_seed
from bilateral_rl.analysis.samples import finite_pairs
from bilateral_rl.analysis.specialization import ALONE
from bilateral_rl.policies.lesions import INTACT

AT_FLOOR = "at the floor"
_SHARE = 0.1
"""What one network must have kept of the way from its control to the intact network: it has no interval [ours]."""


def above_control(results: pd.DataFrame, metric: str, state: State) -> bool | None:
    """Return whether networks in a state do better than their control, which went through the same lesion and protocol.

    Over two seeds or more that is so if the 95 % interval of the difference (Student's t, paired by seed) lies on the
    better side of 0; of one seed, if it is better by more than a tenth of the way from the control to the intact
    network, which must be the better one: where nothing was learned, nothing was kept.

    Args:
        results: long table (:mod:`bilateral_rl.analysis.results`).
        metric: name of a metric of which more is better, or less.
        state: the networks; those of its control are looked up.

    Returns:
        None where that cannot be told: there is no control, or no seed for which both have a value.
    """
    states = (state, state.control, replace(state, lesion=INTACT))
    samples = [by_seed(results, metric, one) for one in states]
    table = pd.concat(samples, axis=1, join="outer").loc[lambda t: t.index.isin(samples[0].index)]
    sign = -1.0 if find_metric(metric).better == "lower" else 1.0
    return is_above(*(sign * table.iloc[:, i].to_numpy(dtype=np.float64) for i in range(3)))


def is_above(values: ArrayLike, control: ArrayLike, intact: ArrayLike) -> bool | None:
    """Return whether values lie above those of their control, by the rule of :func:`above_control`.

    Args:
        values: (n,), one a seed, more is better; NaN where there is none, like in the other two.
        control: (n,), of the same seeds.
        intact: (n,), of the same networks without the lesion.
    """
    kept, fresh = finite_pairs(values, control)
    if not len(kept):
        return None
    if len(kept) > 1:
        from bilateral_rl.analysis.intervals import difference_interval  # SciPy's statistics take long to load

        return difference_interval(kept, fresh, paired=True).low > 0
    both = np.isfinite(np.asarray(values, dtype=np.float64)) & np.isfinite(np.asarray(control, dtype=np.float64))
    whole = float(np.asarray(intact, dtype=np.float64)[both][0])
    gain, needed = float(kept[0] - fresh[0]), _SHARE * (whole - float(fresh[0]))
    return gain > needed > 0 if np.isfinite(whole) else gain > 0


def at_floor(results: pd.DataFrame, metric: str, state: State) -> bool:
    """Return whether neither side of networks, working alone, does better than its control.

    A specialization index of such networks means nothing and is shown as :data:`AT_FLOOR`.

    Args:
        results: long table (:mod:`bilateral_rl.analysis.results`); without a control in it nothing is at the floor.
        metric: name of the metric that the index is of.
        state: the networks; their lesion does not matter.
    """
    return all(above_control(results, metric, state.after(lesion)) is False for lesion in ALONE.values())
