"""What is at the floor: no better than networks that had learned nothing and went through the same."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from treatments import treated

from bilateral_rl.analysis.floor import above_control, at_floor, is_above
from bilateral_rl.analysis.results import COLUMNS, State

NAN = float("nan")
STATE = State("random_reach", "cc_s", "deep_dominant", "output")


def table(metric="goal_completion_5cm", **values):
    """Values by seed, by lesion and network: ``deep_dominant__fresh=[1, 2]``."""
    rows = [
        ("cc_s", "random_reach", "bptt", seed, *place, metric, value)
        for name, of_seeds in values.items()
        for lesion, network in [name.split("__")]
        for place in [(lesion, *treated("output", network))]
        for seed, value in enumerate(of_seeds)
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def test_over_seeds_the_interval_of_the_paired_difference_decides():
    control, kept = np.array([10.0, 20.0, 30.0]), np.array([12.0, 21.5, 33.0])
    assert stats.ttest_rel(kept, control).pvalue < 0.05 < stats.ttest_ind(kept, control).pvalue
    for above, difference in ((True, 0.0), (False, -1.5)):
        results = table(deep_dominant__trained=kept + difference, deep_dominant__fresh=control)
        assert above_control(results, "goal_completion_5cm", STATE) is above
    assert is_above(kept, control, [90, 90, 90])
    assert not is_above(control, kept, [90, 90, 90])
    assert is_above([1.0, 2.0], [0.5, 1.5], [NAN, NAN])  # without spread the difference is exact


def test_less_is_better_where_the_metric_says_so():
    few, many = [2.0, 2.1, 2.2], [9.0, 9.3, 9.1]
    results = table("final_error", deep_dominant__trained=few, deep_dominant__fresh=many)
    assert above_control(results, "final_error", STATE)
    assert above_control(results.assign(metric="goal_completion_5cm"), "goal_completion_5cm", STATE) is False
    one = table("final_error", deep_dominant__trained=[8.1], deep_dominant__fresh=[9.0], intact__trained=[1.0])
    assert above_control(one, "final_error", STATE)
    assert above_control(one.replace(8.1, 8.3), "final_error", STATE) is False


@pytest.mark.parametrize(
    ("kept", "control", "intact", "above"),
    [(19.0, 10.0, 90.0, True), (17.0, 10.0, 90.0, False), (18.0, 10.0, 90.0, False), (11.0, 10.0, NAN, True),
     (9.0, 10.0, 0.0, False), (10.0, 10.0, 10.0, False), (12.0, 10.0, 10.0, False), (12.0, 10.0, 9.0, False)],
)  # fmt: skip
def test_of_one_seed_a_tenth_of_the_way_to_the_intact_network_decides(kept, control, intact, above):
    assert is_above([kept], [control], [intact]) is above
    assert is_above([NAN, kept], [5.0, control], [50.0, intact]) is above


def test_without_a_control_or_values_it_cannot_be_told():
    assert above_control(table(deep_dominant__trained=[1.0, 2.0]), "goal_completion_5cm", STATE) is None
    no_values = table(deep_dominant__trained=[NAN, 1.0], deep_dominant__fresh=[0.0, NAN])
    assert above_control(no_values, "goal_completion_5cm", STATE) is None


def test_seeds_are_paired_whatever_their_order():
    results = table(deep_dominant__trained=[11.0, 21.1, 31.0], deep_dominant__fresh=[10.0, 20.0, 30.0])
    assert above_control(results.iloc[::-1], "goal_completion_5cm", STATE)


def test_networks_are_at_the_floor_where_neither_side_is_above_its_control():
    floor, high = [10.0, 11.0, 9.0], [60.0, 62.0, 59.0]
    control = {"deep_dominant__fresh": [10.0, 10.0, 10.0], "deep_non_dominant__fresh": [10.0, 10.0, 10.0]}
    for dominant, non_dominant, expected in ((floor, floor, True), (high, floor, False), (floor, high, False)):
        results = table(deep_non_dominant__trained=dominant, deep_dominant__trained=non_dominant, **control)
        assert at_floor(results, "goal_completion_5cm", State("random_reach", "cc_s", protocol="output")) is expected
        without = results[results["network"] == "trained"]
        assert not at_floor(without, "goal_completion_5cm", State("random_reach", "cc_s", protocol="output"))
