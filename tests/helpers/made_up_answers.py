"""Readings with made-up verdicts: claims of one or two components, each with the effect that is asked for."""

import math

from bilateral_rl.analysis.intervals import Interval
from bilateral_rl.analysis.power import Design, Spread
from bilateral_rl.claims import Claim, Component, Judgement
from bilateral_rl.study.answer import Answer

S, N, U = "supported", "not supported", "undecided"
CHOICES = {"what adapts": "output", "epochs": "1", "measure of a reach": "completion", "goal of a reach": "5 cm"}


def interval(value, half=0.1, n=5):
    return Interval(value, value - half, value + half, n)


def component(verdict, effect=0.2, text="a > b", **values):
    """A component whose effect is a share of a mean of 50."""
    fields = {
        "measured": "a 60 %, b 50 %",
        "quantity": "difference",
        "unit": "points",
        "test": "Welch's t test",
        "p": 0.03,
        "design": Design("direction", 5.0, (Spread(2.0, 5), Spread(2.0, 5))),
    }
    estimate = Interval(50 * effect, 50 * effect - 5, 50 * effect + 5, 5)
    return Component(text=text, estimate=estimate, verdict=verdict, effect=interval(effect), **(fields | values))


def missing(text="c > d"):
    """A component of which nothing was measured."""
    nothing = Interval(math.nan, math.nan, math.nan, 0)
    return Component(text, "", "", "", nothing, U, note="no results of c")


def judgement(name, verdicts, anchor=None, **choices):
    """A reading whose claims C1, C2, … have these verdicts, or components."""
    claims = [
        Claim(f"C{i}", f"Statement {i}.", tuple(parts) if isinstance(parts, list) else (component(parts, i / 10),))
        for i, parts in enumerate(verdicts, start=1)
    ]
    chosen = {name.replace("_", " "): value for name, value in choices.items()}
    return Judgement(name, claims, anchor, CHOICES | chosen, f"Why {name}.", f"Source of {name}.")


# Four claims: one holds everywhere, one nowhere, and two turn, on what adapts and on the goal.
TEXT = judgement("text", [S, N, U, S])
EVERYTHING = judgement("everything", [S, N, S, S], what_adapts="everything")
TEXT_GOAL = judgement("text-goal", [S, U, U, N], "text", goal_of_a_reach="1 cm")
EVERYTHING_GOAL = judgement(
    "everything-goal", [S, N, S, N], "everything", what_adapts="everything", goal_of_a_reach="1 cm"
)
EVERYTHING_EPOCHS = judgement("everything-epochs", [S, N, U, S], "everything", what_adapts="everything", epochs="3")
FIVE = [TEXT, EVERYTHING, EVERYTHING_EPOCHS, EVERYTHING_GOAL, TEXT_GOAL]


def five():
    return Answer(FIVE)
