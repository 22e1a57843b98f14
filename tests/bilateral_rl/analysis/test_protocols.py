"""Lesion protocols: their names, what a command line asks for, and the numbers that a run gives them."""

import itertools

import pytest

from bilateral_rl.analysis.protocols import RETRAINED, Protocol
from bilateral_rl.config.hyperparameters import BPTTHyperparameters
from bilateral_rl.config.parse import build
from bilateral_rl.config.schema import BPTTConfig
from bilateral_rl.io.errors import UserError

OPTIONS = {
    "epochs": (1, 3),
    "learning_rate": (None, 0.01, 1e-5, 0.1 + 0.2),
    "penalty": (None, "activity"),
    "penalty_coefficient": (None, 0.0, 0.0001),
    "optimizer": ("fresh", "continued"),
    "trials": ("new", "training"),
    "penalize_unreached": (False, True),
}


def all_protocols():
    yield Protocol("none")
    for retrain in ("output", "combination", "everything"):
        for values in itertools.product(*OPTIONS.values()):
            yield Protocol(retrain, **dict(zip(OPTIONS, values, strict=True)))


def test_every_protocol_has_a_name_and_words_of_its_own_and_the_name_brings_it_back():
    protocols = list(all_protocols())
    assert len({protocol.name for protocol in protocols}) == len(protocols)
    assert len({protocol.words for protocol in protocols}) == len(protocols)
    assert [Protocol.parse(protocol.name) for protocol in protocols] == protocols


@pytest.mark.parametrize(
    ("protocol", "name"),
    [
        (Protocol(), "output"),
        (Protocol("everything", epochs=3), "everything-3-epochs"),
        (Protocol("output", learning_rate=0.01), "output-lr-0.01"),
        (Protocol("everything", optimizer="continued"), "everything-continued"),
        (Protocol("output", trials="training"), "output-training-trials"),
        (Protocol("everything", penalty="activity", penalty_coefficient=0.01), "everything-penalty-activity-0.01"),
    ],
)
def test_names_are_short(protocol, name):
    assert protocol.name == name


@pytest.mark.parametrize(
    "name",
    ["", "all", "none-3-epochs", "output-1-epochs", "output-0-epochs", "output-lr-0.010", "output-lr-1e999",
     "output-lr-0", "output-penalty", "output-continued-3-epochs", "output ", "output-lr-" + "1" * 300, "\x1b[31mnone"],
)  # fmt: skip
def test_what_is_no_name_is_refused(name):
    with pytest.raises(UserError, match="no lesion protocol"):
        Protocol.parse(name)


def test_nothing_can_be_set_of_a_retraining_that_there_is_not():
    with pytest.raises(UserError, match="nothing is retrained"):
        build(Protocol, {"retrain": "none", "epochs": 2})


def test_numbers_are_the_runs_own_unless_the_protocol_says_others():
    run = BPTTConfig(bptt=BPTTHyperparameters(learning_rate=0.02, penalty_coefficient=0.3))
    own = Protocol("everything").resolved(run)
    assert (own.learning_rate, own.penalty, own.penalty_coefficient) == (0.02, "weights", 0.3)
    of_kind = Protocol("everything", penalty="activity").resolved(run)  # not the λ of another kind of penalty
    assert (of_kind.penalty, of_kind.penalty_coefficient) == ("activity", 0.01)
    said = Protocol("output", learning_rate=0.1, penalty="weights", penalty_coefficient=0.0).resolved(run)
    assert (said.learning_rate, said.penalty, said.penalty_coefficient) == (0.1, "weights", 0.0)
    assert Protocol("none").resolved(run) == Protocol("none")


def test_a_rate_that_changed_over_the_training_gives_way_to_the_papers():
    for last, expected in ((None, 0.02), (0.02, 0.02), (0.0, 0.001), (0.03, 0.001)):
        run = BPTTConfig(bptt=BPTTHyperparameters(learning_rate=0.02, final_learning_rate=last))
        assert Protocol("output").resolved(run).learning_rate == expected
        assert Protocol("output", learning_rate=0.1).resolved(run).learning_rate == 0.1


def test_what_can_be_retrained():
    assert list(RETRAINED) == ["none", "output", "combination", "everything"]
