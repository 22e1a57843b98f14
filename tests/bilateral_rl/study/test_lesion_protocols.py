"""Lesion studies by several protocols: which optimizer goes on, what the table says, and how they are stacked."""

import pandas as pd
import pytest
from lesion_studies import assert_same, evaluated, retrained_by_hand, run_study, study_of, values_of, with_config

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import LESIONS
from bilateral_rl.study.lesioning import LesionStudy
from bilateral_rl.training.moments import trained_moments


def test_an_optimizer_is_continued_where_there_was_one_and_the_control_begins_anew(bptt_run):
    protocols = (Protocol("everything"), Protocol("everything", optimizer="continued"))
    results = run_study(bptt_run, lesions=("callosum",), protocols=protocols)
    state = {"seed": 1, "lesion": "callosum"}
    fresh, continued = ({**state, "protocol": protocol.name} for protocol in protocols)
    moments = trained_moments(bptt_run, [1])
    policy = retrained_by_hand(bptt_run, 1, LESIONS["callosum"], protocol=protocols[1], moments=moments)
    found = values_of(results, **continued, network="trained")
    assert_same(found, evaluated(bptt_run, policy, "callosum"))
    assert found["effort"] != values_of(results, **fresh, network="trained")["effort"]
    assert_same(values_of(results, **fresh, network="fresh"), values_of(results, **continued, network="fresh"))
    used = results[results["protocol"] == continued["protocol"]].groupby("network")["optimizer"].unique()
    assert {network: list(values) for network, values in used.items()} == {
        "trained": ["continued"],
        "fresh": ["fresh"],
    }


def test_an_optimizer_goes_on_with_the_weights_that_it_left(bptt_run):
    tensors = bptt_run.load_weights("final")
    bptt_run.save_weights("final", {name: t if name == "seeds" else 2 * t for name, t in tensors.items()})
    with pytest.raises(UserError, match="not of its weights 'final'"):
        study_of(bptt_run, protocols=(Protocol("output", optimizer="continued"),))


def test_the_columns_hold_the_numbers_that_were_used(bptt_run):
    with_config(bptt_run, bptt={"penalty": "activity", "penalty_coefficient": 0.5, "learning_rate": 0.03})
    protocols = (Protocol("none"), Protocol("output"), Protocol("everything", 2, 0.01, "weights"))
    results = run_study(bptt_run, only=0, lesions=("callosum",), protocols=protocols, control=False, trials=2)
    columns = [
        "protocol",
        "retrain",
        "epochs",
        "learning_rate",
        "penalty",
        "penalty_coefficient",
        "optimizer",
        "trials",
    ]
    rows = results[columns].drop_duplicates().astype(object)
    assert rows.where(rows.notna(), None).to_numpy().tolist() == [
        ["none", "none", 0, None, "none", None, "none", "none"],
        ["output", "output", 1, 0.03, "activity", 0.5, "fresh", "new"],
        ["everything-2-epochs-lr-0.01-penalty-weights", "everything", 2, 0.01, "weights", 0.001, "fresh", "new"],
    ]


def test_lesions_in_one_stack_bring_the_same_as_one_after_the_other(bptt_run, monkeypatch):
    """As on a GPU, which has room for them."""
    heard = []
    for at_once in (1, 2, 8):
        monkeypatch.setattr(LesionStudy, "_at_once", at_once)
        protocols = (Protocol("none"), Protocol("everything", optimizer="continued"), Protocol("output"))
        study = study_of(bptt_run, protocols=protocols, lesions=("callosum", "shallow_dominant"))
        heard.append((study.run(lambda *state: heard.append(state[0])), at_once))
    tables = [item[0] for item in heard if isinstance(item, tuple)]
    for other in tables[1:]:
        pd.testing.assert_frame_equal(other, tables[0], check_exact=True)
    assert [item for item in heard if isinstance(item, int)] == [0, 1, 2, 3, 0, 2, 3, 0, 3]


def test_a_study_without_any_protocol_is_refused(bptt_run):
    with pytest.raises(UserError, match="needs a protocol"):
        study_of(bptt_run, protocols=())
