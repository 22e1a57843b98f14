"""Whether deep lesions leave more than shallow ones (C6), side by side and protocol by protocol."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from bilateral_rl.analysis.intervals import difference_interval, hedges_g
from bilateral_rl.analysis.results import State, by_seed
from bilateral_rl.analysis.samples import align
from bilateral_rl.analysis.statistics import holm, paired_test
from bilateral_rl.vocabulary import SIDES


def deep_minus_shallow(results: pd.DataFrame, metric: str, states: Sequence[State]) -> pd.DataFrame:
    """Compare a deep with a shallow lesion of the same side, paired by seed.

    Columns: ``model``, ``protocol``, ``side``; ``n`` seeds that have both; the mean ``difference`` (deep − shallow)
    with its 95 % interval ``low`` to ``high`` by Student's t; Hedges' ``g`` of the pairs; ``p_paired`` of the paired t
    test alone; ``p_holm``, the same adjusted for all models and sides of one protocol, so that it does not depend on
    which other protocols were tried; ``note``.

    Args:
        results: long table (:mod:`bilateral_rl.analysis.results`), of one algorithm.
        metric: name of the metric.
        states: networks by model and protocol; their lesions do not matter.

    Returns:
        A row a state and side; a side that was not lesioned both ways has none.
    """
    rows = []
    for state in states:
        for side in SIDES:
            deep, shallow = (by_seed(results, metric, state.after(f"{depth}_{side}")) for depth in ("deep", "shallow"))
            pairs = align(deep, shallow)
            if not len(pairs[0]):
                continue
            difference, test = difference_interval(*pairs, paired=True), paired_test(*pairs)
            rows.append(
                {
                    "model": state.model, "protocol": state.protocol, "side": side, "n": difference.n,
                    "difference": difference.value, "low": difference.low, "high": difference.high,
                    "g": hedges_g(*pairs, paired=True).value, "p_paired": test.p, "note": test.note,
                }
            )  # fmt: skip
    columns = ["model", "protocol", "side", "n", "difference", "low", "high", "g", "p_paired", "note"]
    table = pd.DataFrame(rows, columns=columns)
    table.insert(columns.index("note"), "p_holm", table.groupby("protocol")["p_paired"].transform(holm))
    return table
