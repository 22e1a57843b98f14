"""The long table of results: what is picked from it, and what is no such table."""

import numpy as np
import pandas as pd
import pytest
from treatments import AS_TRAINED, RETRAINED

from bilateral_rl.analysis.results import COLUMNS, State, by_seed, read_results
from bilateral_rl.io.errors import UserError

ROWS = [
    ("cc_s", "random_reach", "bptt", 10, "intact", *AS_TRAINED, "effort", 1.5),
    ("cc_s", "random_reach", "bptt", 2, "intact", *AS_TRAINED, "effort", 0.1 + 0.2),
    ("cc_s", "random_reach", "bptt", 2, "intact", *RETRAINED, "effort", 3.0),
    ("cc_s", "random_reach", "bptt", 2, "callosum", *AS_TRAINED, "effort", 4.0),
    ("cc_s", "random_reach", "bptt", 2, "intact", *AS_TRAINED, "sparc", np.nan),
    ("cc_s", "hold_position", "bptt", 2, "intact", *AS_TRAINED, "effort", 6.0),
    ("bi_s", "random_reach", "bptt", 2, "intact", *AS_TRAINED, "effort", 7.0),
]
"""Each differs from the second in one column, but for the first, another seed of the same."""


@pytest.fixture
def results():
    return pd.DataFrame(ROWS, columns=list(COLUMNS))


def test_the_columns_are_those_of_the_long_form():
    assert ",".join(COLUMNS) == (
        "model,task,algo,seed,lesion,network,protocol,retrain,epochs,learning_rate,penalty,penalty_coefficient,"
        "optimizer,trials,metric,value"
    )


def test_values_are_picked_by_every_column_and_stand_in_the_order_of_the_seeds(results):
    for wanted, values in (
        (("effort", State("random_reach", "cc_s")), {2: 0.1 + 0.2, 10: 1.5}),
        (("effort", State("random_reach", "cc_s", "intact", "output")), {2: 3.0}),
        (("effort", State("random_reach", "cc_s", "callosum")), {2: 4.0}),
        (("effort", State("hold_position", "cc_s")), {2: 6.0}),
        (("effort", State("random_reach", "bi_s")), {2: 7.0}),
        (("effort", State("random_reach", "uni_b")), {}),
        (("final_error", State("random_reach", "cc_s")), {}),
    ):
        found = by_seed(results, *wanted)
        assert list(found.items()) == list(values.items())


def test_several_values_of_a_seed_are_refused(results):
    with pytest.raises(UserError, match=r"several values of effort in random_reach for seed 2 of cc_s \(callosum, wi"):
        by_seed(pd.concat([results, results.assign(algo="ppo")]), "effort", State("random_reach", "cc_s", "callosum"))


def test_a_table_comes_back_from_its_file(results, tmp_path):
    results.to_csv(tmp_path / "results.csv", index=False)
    pd.testing.assert_frame_equal(read_results(tmp_path / "results.csv"), results, check_exact=True)


def test_a_file_that_is_no_such_table_is_refused(tmp_path):
    for content, says in (
        (b"", "is damaged"),
        (b"\xff\xfe\x00\x01", "is damaged"),
        (b'model,task\n"', "is damaged"),
        (b"model,task\ncc_s,random_reach\n", "columns must be model, task, algo, seed, lesion, network, protocol"),
        (
            (
                ",".join(COLUMNS)
                + "\ncc_s,random_reach,ppo,1,intact,trained,none,none,perhaps,,none,,none,none,effort,1\n"
            ).encode(),
            "is damaged",
        ),
    ):
        path = tmp_path / "results.csv"
        path.write_bytes(content)
        with pytest.raises(UserError, match=says) as error:
            read_results(path)
        assert str(path) in str(error.value)
        assert "\n" not in str(error.value)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(UserError, match="No such file"):
        read_results(tmp_path / "results.csv")
