import numpy as np
import pandas as pd
from treatments import RETRAINED

from bilateral_rl.analysis.results import COLUMNS, State
from bilateral_rl.analysis.specialization import specialization_by_seed, specialization_index


def test_the_index_says_which_side_does_the_task():
    with np.errstate(all="raise"):
        index = specialization_index([90, 0, 30, 40, 0], [30, 50, 30, 0, 0])
    np.testing.assert_allclose(index, [0.5, -1, 0, 1, np.nan])


def test_the_index_changes_its_sign_with_the_sides_and_has_no_unit():
    generator = np.random.default_rng(0)
    d, n = generator.random((2, 20))
    np.testing.assert_allclose(specialization_index(n, d), -specialization_index(d, n))
    np.testing.assert_allclose(specialization_index(100 * d, 100 * n), specialization_index(d, n))


def test_the_index_of_one_pair_is_a_number_and_a_missing_side_gives_nan():
    assert float(specialization_index(3.0, 1.0)) == 0.5
    assert np.isnan(specialization_index(np.nan, 1.0))


def test_the_index_is_of_the_seeds_whose_sides_were_both_tested_alone():
    sides = [("deep_non_dominant", 2, 30.0), ("deep_non_dominant", 1, 20.0), ("deep_dominant", 2, 10.0)]
    rows = [("cc_s", "random_reach", "bptt", seed, side, *RETRAINED, "effort", value) for side, seed, value in sides]
    results = pd.DataFrame(rows, columns=list(COLUMNS))
    assert dict(specialization_by_seed(results, "effort", State("random_reach", "cc_s", protocol="output"))) == {2: 0.5}
    assert specialization_by_seed(results, "effort", State("random_reach", "cc_s")).empty
