"""Which lesion protocols the arguments of a lesion study ask for, and which contradictions are refused."""

import pytest

from bilateral_rl.analysis.protocols import DEFAULT_PROTOCOLS, Protocol
from bilateral_rl.api.protocols import chosen_protocols
from bilateral_rl.io.errors import UserError

NOTHING, OUTPUT, EVERYTHING = DEFAULT_PROTOCOLS


def chosen(*retrain, **settings):
    return chosen_protocols(retrain, settings)


def test_if_nothing_is_said_there_are_the_networks_as_they_are_the_text_and_everything():
    assert [protocol.name for protocol in chosen()] == ["none", "output", "everything"]
    assert chosen(epochs=None, penalty=None) == DEFAULT_PROTOCOLS


def test_what_is_retrained_is_chosen_in_any_order_and_each_once():
    assert chosen("everything", "none", "everything") == (EVERYTHING, NOTHING)
    assert chosen("combination") == (Protocol("combination"),)
    assert chosen("none") == chosen_protocols("none", {}) == (NOTHING,)


def test_settings_hold_for_all_that_retrain_something():
    settings = {
        "epochs": 3, "learning_rate": 0.01, "optimizer": "continued", "trials": "training", "penalty": "activity",
        "penalty_coefficient": 0.0,
    }  # fmt: skip
    assert chosen("output", "none", **settings) == (Protocol("output", **settings), NOTHING)
    assert chosen(epochs=2) == (NOTHING, Protocol("output", epochs=2), Protocol("everything", epochs=2))


def test_protocols_of_any_kind_stand_side_by_side_by_their_names():
    other = Protocol("output", epochs=3, learning_rate=0.01)
    assert chosen("none", "output", other.name, "everything") == (NOTHING, OUTPUT, other, EVERYTHING)


@pytest.mark.parametrize(
    ("retrain", "settings", "says"),
    [
        (["all"], {}, "Unknown --retrain 'all'; choose from none, output, combination, everything"),
        (["output-0-epochs"], {}, "Unknown --retrain 'output-0-epochs'"),
        (["none"], {"epochs": 2}, "--retrain-epochs says how to retrain, but nothing is retrained"),
        (
            ["none", "none"],
            {"penalty_coefficient": 0.1},
            "--retrain-penalty-coefficient says how to",
        ),
        (["everything-3-epochs"], {"learning_rate": 0.1}, "leave out --retrain-learning-rate"),
        ([], {"epochs": 0}, "--retrain-epochs: epochs must be at least 1, got 0"),
        ([], {"learning_rate": -1.0}, "--retrain-learning-rate: learning_rate must be above 0, got -1"),
        ([], {"learning_rate": float("nan")}, "--retrain-learning-rate: "),
        ([], {"penalty": "l1"}, "--retrain-penalty: Unknown penalty 'l1'; choose from weights, activity"),
        ([], {"optimizer": "sgd"}, "--retrain-optimizer: Unknown optimizer 'sgd'; choose from fresh, continued"),
        ([], {"trials": "old"}, "--retrain-trials: Unknown trials 'old'; choose from new, training"),
    ],
)
def test_a_contradiction_or_a_slip_is_one_sentence(retrain, settings, says):
    with pytest.raises(UserError) as refusal:
        chosen(*retrain, **settings)
    assert says in str(refusal.value)
    assert str(refusal.value).endswith(".")
