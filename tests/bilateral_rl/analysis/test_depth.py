import numpy as np
import pandas as pd
import pytest
from scipy import stats
from treatments import treated

from bilateral_rl.analysis.depth import deep_minus_shallow
from bilateral_rl.analysis.results import COLUMNS, State

STATES = [State("random_reach", "cc_s", protocol=name) for name in ("output", "everything")]
VALUES = {
    ("output", "shallow_dominant"): [10.0, 12.0, 11.0, 14.0],
    ("output", "deep_dominant"): [12.0, 13.0, 15.0, 15.0],
    ("output", "shallow_non_dominant"): [9.0, 8.0, 9.0, 7.0],
    ("output", "deep_non_dominant"): [9.5, 7.0, 10.5, 7.5],
    ("everything", "shallow_dominant"): [40.0, 42.0, 51.0, 44.0],
    ("everything", "deep_dominant"): [52.0, 53.0, 65.0, 55.0],
}


def results(values=VALUES):
    rows = [
        ("cc_s", "random_reach", "bptt", seed, lesion, *treated(protocol, network), "effort", factor * value)
        for (protocol, lesion), of_seeds in values.items()
        for seed, value in enumerate(of_seeds)
        for network, factor in (("trained", 1.0), ("fresh", -7.0))
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def test_a_side_is_compared_by_pairs_of_seeds():
    table = deep_minus_shallow(results().iloc[::-1], "effort", STATES)
    assert list(zip(table["protocol"], table["side"], strict=True)) == [
        ("output", "dominant"), ("output", "non_dominant"), ("everything", "dominant"),
    ]  # fmt: skip
    for row in table.to_dict("records"):
        deep, shallow = (np.array(VALUES[row["protocol"], f"{depth}_{row['side']}"]) for depth in ("deep", "shallow"))
        expected = stats.ttest_rel(deep, shallow)
        assert row["difference"] == pytest.approx((deep - shallow).mean())
        assert (row["low"], row["high"]) == pytest.approx(tuple(expected.confidence_interval()))
        assert (row["p_paired"], row["n"]) == (pytest.approx(expected.pvalue), 4)
        assert np.sign(row["g"]) == np.sign(row["difference"])


def test_the_sides_of_a_protocol_are_one_family():
    table = deep_minus_shallow(results(), "effort", STATES)
    first, second, alone = table["p_paired"]
    assert first < second < 1
    assert table["p_holm"].tolist() == pytest.approx([2 * first, max(2 * first, second), alone])


def test_one_seed_has_a_difference_and_no_test():
    table = deep_minus_shallow(results({key: values[:1] for key, values in VALUES.items()}), "effort", STATES[:1])
    assert table["difference"].tolist() == [2.0, 0.5]
    assert table[["low", "high", "p_holm"]].isna().all(axis=None)


def test_a_side_that_was_not_lesioned_both_ways_has_no_row():
    only = {key: values for key, values in VALUES.items() if "deep" in key[1]}
    table = deep_minus_shallow(results(only), "effort", STATES)
    assert table.empty
    assert "p_holm" in table
