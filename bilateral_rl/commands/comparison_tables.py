"""Comparisons as tables that fit into 80 columns."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pandas as pd
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bilateral_rl.analysis.comparison import Comparison, ModelComparison
from bilateral_rl.analysis.formats import decimals_for, f_statistic, fixed, p_equation, p_value
from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.analysis.samples import FEW_SEEDS
from bilateral_rl.analysis.statistics import OmnibusTest
from bilateral_rl.figures.labels import with_unit
from bilateral_rl.policies.lesions import lesion_words

_TESTS = {"p_tukey": "Tukey", "p_games_howell": "Games–Howell", "p_holm": "p"}
"""Headings of the p-values of pairs, by their column in ``Comparison.pairs``."""


def print_comparison(comparison: Comparison, subtitle: str, console: Console) -> None:
    """Print the groups, the tests, the pairs, and notes on them.

    Args:
        comparison: what was compared.
        subtitle: words about it for the title; may be empty.
        console: where to print.
    """
    title = ", ".join(part for part in (comparison.task, subtitle) if part)
    console.print(f"[bold]{escape(f'{title}: {with_unit(find_metric(comparison.metric))}')}", highlight=False)
    decimals = _decimals(comparison.groups)
    console.print(_groups_table(comparison, decimals))
    if isinstance(comparison, ModelComparison):
        for test in (comparison.anova, comparison.welch):
            console.print(_omnibus(test), highlight=False)
    console.print(_pairs_table(comparison, decimals))
    for note in _notes(comparison):
        console.print(f"[yellow]Note:[/yellow] {escape(note)}", highlight=False)


def print_methods(comparison: Comparison, console: Console) -> None:
    """Print how the numbers of comparisons of this kind were computed."""
    words = (
        "Intervals: 95 %, bootstrap over the seeds, too narrow where these are few (of ten they cover nine times in "
        "ten): go by the tests. g: Hedges' g; p: Tukey's HSD and Games–Howell."
    )
    if not isinstance(comparison, ModelComparison):
        words = (
            "Intervals: 95 %, of means by bootstrap over the seeds, of differences by Student's t; g: Hedges' g of the "
            "paired differences, not to be compared with that of models; "
            "p: t tests paired by seed, adjusted by Holm."
        )
        if "fresh" in comparison.groups and comparison.groups["fresh"].notna().any():
            words += " fresh: mean of freshly initialized networks, treated alike."
    console.print(words, highlight=False)


def _groups_table(comparison: Comparison, decimals: int) -> Table:
    table = Table("")
    table.columns[0].overflow = "fold"
    has_control = "fresh" in comparison.groups and comparison.groups["fresh"].notna().any()
    for head in ("mean", "sd", "95 % interval", "seeds", *(["fresh"] if has_control else [])):
        table.add_column(head, justify="right", no_wrap=True)
    for name, row in comparison.groups.iterrows():
        numbers = (fixed(row[column], decimals) for column in ("mean", "sd"))
        interval, control = _interval(row["low"], row["high"], decimals), []
        if has_control:
            control = [f"[dim]{fixed(row['fresh'], decimals)}"]
        table.add_row(escape(_name(comparison, name)), *numbers, interval, str(int(row["n"])), *control)
    return table


def _pairs_table(comparison: Comparison, decimals: int) -> Table:
    """A section for each first group."""
    test_columns = [name for name in _TESTS if name in comparison.pairs]
    table = Table("first − second")
    table.columns[0].overflow = "fold"
    for head in ("difference [95 %]", "g", *(_TESTS[name] for name in test_columns)):
        table.add_column(head, justify="right", no_wrap=True)
    for first, pairs in comparison.pairs.groupby("first", sort=False):
        table.add_section()
        table.add_row(f"[bold]{escape(_name(comparison, first))}[/bold] −")
        for pair in pairs.to_dict("records"):
            difference = f"{fixed(pair['difference'], decimals, '+')} {_interval(pair['low'], pair['high'], decimals)}"
            tests = (p_value(pair[name]) for name in test_columns)
            table.add_row(escape(_name(comparison, pair["second"])), difference, fixed(pair["g"], 2, "+"), *tests)
    return table


def _omnibus(test: OmnibusTest) -> str:
    if math.isnan(test.p):
        return f"{test.name}: no test ({test.note or 'all values are equal'})"
    return f"{test.name}: {f_statistic(test)}, {p_equation(test.p)}" + (f" ({test.note})" if test.note else "")


def _notes(comparison: Comparison) -> Iterator[str]:
    groups = comparison.groups
    for note, members in groups[groups["note"] != ""].groupby("note", sort=False):
        names = ", ".join(_name(comparison, name) for name in members.index)
        yield f"{'every group' if len(members) == len(groups) else names}: {note}."
    if groups["n"].between(2, FEW_SEEDS - 1).any():
        yield "tests of so few seeds have hardly a chance to find a difference."


def _name(comparison: Comparison, group: object) -> str:
    """Models are printed as they are typed."""
    return str(group) if isinstance(comparison, ModelComparison) else lesion_words(str(group))


def _decimals(groups: pd.DataFrame) -> int:
    """As many as show the usual spread in two significant digits, or a lone seed in three."""
    spread = groups["sd"][groups["sd"] > 0]
    size, digits = (spread.median(), 2) if len(spread) else (groups["mean"].abs().median(), 3)
    return max(decimals_for(size, digits), 1)


def _interval(low: float, high: float, decimals: int) -> str:
    return "" if math.isnan(low) else f"[{fixed(low, decimals)}, {fixed(high, decimals)}]"
