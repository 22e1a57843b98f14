import numpy as np
import pandas as pd
import pytest

from bilateral_rl.analysis.formats import number, p_text, spread


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ([90.0, 92.0, 94.0], "92.0 ± 2.0"),
        ([1.0, 2.0], "1.50 ± 0.71"),
        ([80.0, 100.0, 120.0], "100 ± 20"),
        ([1.5001, 1.5003], "1.50020 ± 0.00014"),
        ([-0.001, 0.0, 0.001], "0.0000 ± 0.0010"),
        ([1.0, np.nan, 2.0], "1.50 ± 0.71"),
        ([3.0, 3.0], "3 ± 0"),
        ([2.3456], "2.35"),
        ([1234.56], "1234.6"),
        ([np.nan], "–"),
        ([], "–"),
    ],
)
def test_a_mean_has_as_many_digits_as_its_spread(values, text):
    assert spread(pd.Series(values, dtype=float)) == text


def test_numbers_and_p_values_that_are_none_are_dashes():
    assert [number(x, "+.2f") for x in (1.0, -1.0, np.nan)] == ["+1.00", "-1.00", "–"]
    assert [p_text(p) for p in (0.0009, 0.001, 0.0456, 1.0, np.nan)] == ["< 0.001", "0.001", "0.046", "1.000", "–"]
