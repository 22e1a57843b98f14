import numpy as np
import pandas as pd

from bilateral_rl.analysis.formats import (
    decimals_for,
    f_statistic,
    fixed,
    mean_sd,
    number,
    p_equation,
    p_value,
)
from bilateral_rl.analysis.statistics import OmnibusTest


def test_a_mean_has_as_many_digits_as_its_deviation():
    for values, text in (
        ([90.0, 92.0, 94.0], "92.0 ± 2.0"),
        ([1.0, 2.0], "1.50 ± 0.71"),
        ([80.0, 100.0, 120.0], "100 ± 20"),
        ([1.5001, 1.5003], "1.50020 ± 0.00014"),
        ([-0.001, 0.0, 0.001], "0.0000 ± 0.0010"),
        ([1.0, np.nan, 2.0], "1.50 ± 0.71 (2 of 3 seeds)"),
        ([3.0, 3.0], "3 ± 0"),
        ([2.3456], "2.35"),
        ([1234.56], "1234.6"),
        ([np.nan], "–"),
        ([], "–"),
    ):
        assert mean_sd(pd.Series(values, dtype=float)) == text


def test_the_decimals_of_a_column_may_be_given():
    for values, text in (
        ([90.0, 92.0, 94.0], "+92.0 ± 2.0"),
        ([-0.01, -0.02], "+0.0 ± 0.0"),
        ([1.0, np.nan], "+1.0 (1 of 2 seeds)"),
        ([np.nan], "–"),
    ):
        assert mean_sd(values, 1, "+") == text


def test_numbers_have_three_digits_and_large_ones_a_decimal():
    assert [number(x) for x in (0.0123456, 1.5, 99.96, 123.456, np.nan)] == ["0.0123", "1.5", "100", "123.5", "–"]
    assert [number(x, "+") for x in (1.0, -1.0)] == ["+1", "-1"]
    assert [fixed(x, 2, "+") for x in (1.0, -0.001, np.nan)] == ["+1.00", "+0.00", "–"]


def test_decimals_follow_the_size():
    assert [decimals_for(size, 2) for size in (200, 20, 2, 0.02, 1e-9, 0, np.nan)] == [0, 0, 1, 3, 6, 0, 0]


def test_p_values():
    p_values = (0.0, 0.00099, 0.001, 0.0456, 1.0, np.nan)
    assert [p_value(p) for p in p_values] == ["< 0.001", "< 0.001", "0.001", "0.046", "1.000", "–"]
    words = ["p < 0.001", "p < 0.001", "p = 0.001", "p = 0.046", "p = 1.000", "no test"]
    assert [p_equation(p) for p in p_values] == words


def test_the_statistic_of_an_analysis_of_variance():
    assert f_statistic(OmnibusTest("ANOVA", 15.004, (1, 2.9412), 0.03)) == "F(1, 2.941) = 15.00"
