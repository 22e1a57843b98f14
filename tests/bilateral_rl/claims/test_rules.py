"""From intervals and p-values to verdicts."""

from bilateral_rl.analysis.intervals import Interval
from bilateral_rl.claims.rules import all_of, is_equivalent, is_greater, is_not_conclusively_greater, is_within

NAN, INF = float("nan"), float("inf")


def interval(value, low, high, n=10):
    return Interval(value, low, high, n)


def test_greater():
    for difference, p, verdict in (
        (interval(3, 2, 4), 0.01, "supported"),
        (interval(-3, -4, -2), 0.01, "not supported"),
        (interval(3, -1, 7), 0.2, "undecided"),
        (interval(0.1, -0.7, 0.9), 0.5, "not supported"),  # whatever there is, it does not matter
        (interval(0.1, -0.7, 1.1), 0.5, "undecided"),
        (interval(3, 0.1, 6), 0.06, "undecided"),  # significant only before it was adjusted
        (interval(0.5, 0.1, 0.9), 0.01, "supported"),
        (interval(3, NAN, NAN, n=1), NAN, "undecided"),
        (interval(0, 0, 0), NAN, "not supported"),  # all values equal
        (interval(3, 3, 3), NAN, "undecided"),
    ):
        assert is_greater(difference, p, matters=1.0) == verdict


def test_not_conclusively_greater():
    for difference, p, verdict in (
        (interval(3, 2, 4), 0.01, "not supported"),
        (interval(-3, -4, -2), 0.01, "supported"),
        (interval(3, -1, 7), 0.2, "supported"),  # as many seeds as the paper's do not show it
        (interval(3, -1, 7, n=9), 0.2, "undecided"),
        (interval(0.1, -0.7, 0.9, n=3), 0.5, "supported"),
        (interval(3, NAN, NAN, n=1), NAN, "undecided"),
        (interval(3, 3, 3), NAN, "undecided"),
        (interval(0, 0, 0, n=3), NAN, "supported"),
    ):
        assert is_not_conclusively_greater(difference, p, matters=1.0) == verdict


def test_within():
    for estimate, verdict in (
        (interval(1.2, 1.1, 1.3), "supported"),
        (interval(1.2, 1.0, 1.4), "supported"),
        (interval(1.2, 0.9, 1.3), "undecided"),
        (interval(1.2, 1.1, 1.5), "undecided"),
        (interval(1.2, 0.5, 2.0), "undecided"),
        (interval(0.5, 0.4, 0.9), "not supported"),
        (interval(1.5, 1.41, 1.6), "not supported"),
        (interval(1.2, -INF, INF), "undecided"),
        (interval(1.2, NAN, NAN, n=1), "undecided"),
    ):
        assert is_within(estimate, 1.0, 1.4) == verdict


def test_one_sided_ranges():
    assert is_within(interval(96, 94, 98), 93, INF) == "supported"
    assert is_within(interval(0.5, -0.2, 0.7), -INF, 0.8) == "supported"
    assert is_within(interval(0.5, -INF, INF), -INF, 0.8) == "undecided"
    assert is_within(interval(0.9, 0.85, 0.95), -INF, 0.8) == "not supported"


def test_equivalence_needs_both_tests_and_agrees_with_the_interval():
    for estimate, p, verdict in (
        (interval(0.02, -0.05, 0.09), 0.01, "supported"),
        (interval(0.02, -0.09, 0.13), 0.06, "undecided"),
        (interval(0.3, 0.2, 0.4), 0.999, "not supported"),
        (interval(0.3, 0.05, 0.55), 0.9, "undecided"),
        (interval(0.0, 0.0, 0.0), 0.1, "undecided"),  # no spread at the estimate, but a mean that may be 0
        (interval(0.0, 0.0, 0.0), NAN, "supported"),  # all values equal
        (interval(0.3, 0.3, 0.3), NAN, "not supported"),
        (interval(0.02, NAN, NAN, n=1), NAN, "undecided"),
    ):
        assert is_equivalent(estimate, p, -0.1, 0.1) == verdict


def test_a_claim_needs_all_of_its_components():
    assert all_of(["supported", "supported"]) == "supported"
    assert all_of(["supported", "undecided"]) == "undecided"
    assert all_of(["supported", "undecided", "not supported"]) == "not supported"
    assert all_of([]) == "undecided"
