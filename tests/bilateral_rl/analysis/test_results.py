"""The long table of results: what is picked from it, and what is no such table."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from treatments import AS_TRAINED, RETRAINED

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.analysis.results import (
    COLUMNS,
    TREATMENT,
    State,
    by_seed,
    protocols_in,
    read_results,
    treatment,
)
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


# Versions and protocols

OLD = b"""model,task,algo,seed,lesion,retrained,metric,value
cc_s,random_reach,bptt,0,callosum,False,effort,1.5
cc_s,random_reach,bptt,0,callosum,True,effort,2.5
"""


def test_a_table_of_version_0_1_0_is_of_trained_networks_without_retraining_and_with_that_of_the_output_layer(tmp_path):
    (tmp_path / "old.csv").write_bytes(OLD)
    table = read_results(tmp_path / "old.csv")
    assert tuple(table.columns) == COLUMNS
    state = State("random_reach", "cc_s", "callosum")
    assert list(by_seed(table, "effort", state)) == [1.5]
    assert list(by_seed(table, "effort", replace(state, protocol="output"))) == [2.5]
    assert by_seed(table, "effort", state.control).empty
    assert list(table["epochs"]) == [0, 1]
    assert list(table["penalty"]) == ["none", "unknown"]
    table.to_csv(tmp_path / "new.csv", index=False)
    pd.testing.assert_frame_equal(read_results(tmp_path / "new.csv"), table, check_exact=True)


def test_old_and_new_tables_can_be_read_as_one(results, tmp_path):
    (tmp_path / "old.csv").write_bytes(OLD)
    both = pd.concat([results, read_results(tmp_path / "old.csv")], ignore_index=True)
    assert dict(by_seed(both, "effort", State("random_reach", "cc_s", "callosum"))) == {0: 1.5, 2: 4.0}
    assert both["epochs"].dtype == int


def test_the_columns_say_what_was_really_done():
    used = Protocol("everything", 3, 0.02, "activity", 0.5, "fresh", "training")
    row = treatment(Protocol("everything", 3, optimizer="continued"), "fresh", used)
    named = dict(zip(TREATMENT, row, strict=True))
    assert named == {
        "network": "fresh", "protocol": "everything-3-epochs-continued", "retrain": "everything", "epochs": 3,
        "learning_rate": 0.02, "penalty": "activity", "penalty_coefficient": 0.5, "optimizer": "fresh",
        "trials": "training",
    }  # fmt: skip


def test_protocols_stand_in_the_order_of_their_kinds_and_all_others_after_them(results):
    names = ["everything-3-epochs", "everything", "output-lr-0.01", "none", "combination", "output"]
    table = pd.concat([results.assign(protocol=name) for name in names])
    expected = ["none", "output", "combination", "everything", "everything-3-epochs", "output-lr-0.01"]
    assert protocols_in(table) == expected


@pytest.mark.parametrize(
    ("column", "value"),
    [("network", "new"), ("protocol", "output-1-epochs"), ("retrain", "all"), ("penalty", "l1"),
     ("optimizer", "sgd"), ("trials", "some")],
)  # fmt: skip
def test_words_that_no_table_has_are_refused(results, tmp_path, column, value):
    results.assign(**{column: value}).to_csv(tmp_path / "x.csv", index=False)
    with pytest.raises(UserError, match=f"no table of results.*{value}"):
        read_results(tmp_path / "x.csv")


def test_a_value_may_be_there_once_for_each_protocol_and_network(results, tmp_path):
    path = tmp_path / "x.csv"
    pd.concat([results, results.assign(network="fresh")]).to_csv(path, index=False)
    assert len(read_results(path)) == 2 * len(results)
    pd.concat([results, results.assign(learning_rate=0.1)]).to_csv(path, index=False)
    with pytest.raises(UserError, match="one value more than once"):
        read_results(path)
