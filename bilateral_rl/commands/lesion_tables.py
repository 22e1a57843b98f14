"""Lesions as tables that fit into the terminal, and what they say in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import pandas as pd
from rich.console import Console
from rich.padding import Padding
from rich.table import Table

from bilateral_rl.analysis.depth import deep_minus_shallow
from bilateral_rl.analysis.floor import AT_FLOOR, above_control, at_floor
from bilateral_rl.analysis.formats import decimals_for, fixed, mean_sd, p_value
from bilateral_rl.analysis.hands import contralesional_hand
from bilateral_rl.analysis.metric import Metric, of_hands
from bilateral_rl.analysis.results import FRESH, State, by_seed, protocol_words, protocols_in
from bilateral_rl.analysis.specialization import ALONE, specialization_by_seed
from bilateral_rl.figures.labels import with_unit
from bilateral_rl.policies.lesions import INTACT, lesion_words
from bilateral_rl.vocabulary import Side

_LABEL, _VALUE, _BESIDE = 31, 12, 3
"""Characters of "Goal completion within 5 cm (%)", of "100.0 ± 10.0", and between columns."""


def print_lesions(results: pd.DataFrame, metrics: Sequence[Metric], console: Console) -> None:
    """Print what networks do after each lesion and protocol, and in words what that says.

    Args:
        results: long table (:mod:`bilateral_rl.analysis.results`) of one model that learned one task.
        metrics: what to print; the first one, of which more is better, is what the words are about.
        console: where to print.
    """
    first = results.iloc[0]
    states = [State(first["task"], first["model"], protocol=name) for name in protocols_in(results)]
    lesions = list(dict.fromkeys(results["lesion"]))
    n = max(1, (console.width - _LABEL - _BESIDE - 1) // (_VALUE + _BESIDE))
    for start in range(0, len(states), n):
        console.print(_table(results, metrics, lesions, states[start : start + n]))
        if hands := _by_hand(results, metrics):
            console.print(_hands_table(results, hands, lesions, states[start : start + n]))
    for line in _words(results, metrics[0], [name for name in lesions if name != INTACT], states):
        indent = len(line) - len(line.lstrip())  # kept where the line goes on
        console.print(Padding(line.lstrip(), (0, 0, 0, indent), expand=False), highlight=False)
    differences = deep_minus_shallow(results, metrics[0].name, states)
    if differences["p_holm"].notna().any():
        console.print(f"[bold]Do deep lesions leave more than shallow ones? {with_unit(metrics[0])}", highlight=False)
        console.print(_differences_table(differences))
        console.print(
            "Intervals: 95 %, by Student's t; g: Hedges' g of the paired differences; p: t tests paired by seed, "
            "adjusted by Holm for the sides.",
            highlight=False,
        )


def _table(results: pd.DataFrame, metrics: Sequence[Metric], lesions: Sequence[str], states: Sequence[State]) -> Table:
    """Mean ± standard deviation over the seeds below each metric, a row a lesion, and below it the control's."""
    table = _empty_table(results, states)
    for metric in metrics:
        table.add_section()
        table.add_row(f"[bold]{with_unit(metric)}")
        for name in lesions:
            of_lesion = [state.after(name) for state in states]
            table.add_row(lesion_words(name), *_cells(results, metric, of_lesion))
            if _has_control(results):
                controls = [state.control for state in of_lesion]
                table.add_row("  fresh network", *_cells(results, metric, controls), style="dim")
    return table


def _hands_table(
    results: pd.DataFrame,
    hands: Mapping[str, Mapping[Side, Metric]],
    lesions: Sequence[str],
    states: Sequence[State],
) -> Table:
    """The same of each hand of two, by lesion: after a deep one, of the contralesional and the ipsilesional arm."""
    table = _empty_table(results, states)
    for words, by_hand in hands.items():
        table.add_section()
        table.add_row(f"[bold]{words}")
        for name in lesions:
            of_lesion = [state.after(name) for state in states]
            table.add_row(lesion_words(name), *[""] * len(states))
            for hand, metric in by_hand.items():
                table.add_row(f"  {_hand_words(name, hand)}", *_cells(results, metric, of_lesion))
    if any(contralesional_hand(name) for name in lesions):
        note = "contralesional: the hand opposite to the hemisphere with the deep lesion"
        table.caption = "; ".join(filter(None, (str(table.caption or ""), note)))
    return table


def _by_hand(results: pd.DataFrame, metrics: Sequence[Metric]) -> dict[str, dict[Side, Metric]]:
    """Return the metrics of each hand, by words that say which metric and what the hands do; nothing of one arm."""
    measured, found = set(results["metric"]), {}
    for metric in metrics:
        for role, hands in of_hands(metric, measured).items():
            doing = f", hands that {role}" if role else ""
            found[with_unit(replace(metric, label=f"{metric.label}{doing}"))] = hands
    return found


def _hand_words(lesion: str, hand: Side) -> str:
    """Say whose hand it is, and on which side of a deep lesion."""
    words, contralesional = hand.replace("_", "-"), contralesional_hand(lesion)
    if contralesional is None:
        return f"{words} hand"
    return f"{'contralesional' if hand == contralesional else 'ipsilesional'} ({words})"


def _empty_table(results: pd.DataFrame, states: Sequence[State]) -> Table:
    """A table with a column a state."""
    table = Table()
    table.add_column("lesion", width=_LABEL)
    for state in states:
        table.add_column(protocol_words(state.protocol), justify="right", width=_VALUE)
    if (seeds := results["seed"].nunique()) > 1:
        table.caption = f"mean ± standard deviation over {seeds} seeds"
    return table


def _cells(results: pd.DataFrame, metric: Metric, states: Sequence[State]) -> list[str]:
    return [mean_sd(by_seed(results, metric.name, state), 1) for state in states]


def _words(results: pd.DataFrame, metric: Metric, lesions: Sequence[str], states: Sequence[State]) -> Iterator[str]:
    """What was kept and what was not, and how far the hemispheres have specialized."""
    if not lesions:
        return
    if _has_control(results):
        fresh = "fresh networks that were treated alike (lost or relearned, not kept)"
        yield f"No better than {fresh}, by {metric.label.lower()}:"
        for state in states:
            floored = [name for name in lesions if above_control(results, metric.name, state.after(name)) is False]
            yield f"  {protocol_words(state.protocol)}: {_listed(floored, lesions)}"
    if set(ALONE.values()) <= set(lesions):
        yield "Specialization index (above 0: the dominant side does more alone):"
        for state in states:
            yield f"  {protocol_words(state.protocol)}: {_index(results, metric, state)}"


def _listed(names: Sequence[str], all_names: Sequence[str]) -> str:
    if not names:
        return "no lesion"
    if len(names) == len(all_names):
        return "every lesion"
    rest = [name for name in all_names if name not in names]
    if len(rest) == 1:
        return f"all but {lesion_words(rest[0])}"
    return "; ".join(map(lesion_words, names))


def _index(results: pd.DataFrame, metric: Metric, state: State) -> str:
    if at_floor(results, metric.name, state):
        return AT_FLOOR
    return mean_sd(specialization_by_seed(results, metric.name, state), 3, "+")


def _has_control(results: pd.DataFrame) -> bool:
    return bool((results["network"] == FRESH).any())


def _differences_table(differences: pd.DataFrame) -> Table:
    """Deep minus shallow lesions, a section a protocol and a row a side."""
    table = Table("deep − shallow")
    for head in ("difference [95 %]", "g", "p"):
        table.add_column(head, justify="right", no_wrap=True)
    decimals = max(decimals_for((differences["high"] - differences["low"]).median() / 2, 2), 1)
    for protocol, rows in differences.groupby("protocol", sort=False):
        table.add_section()
        table.add_row(f"[bold]{protocol_words(str(protocol))}")
        for row in rows.to_dict("records"):
            interval = f"[{fixed(row['low'], decimals)}, {fixed(row['high'], decimals)}]"
            difference = f"{fixed(row['difference'], decimals, '+')} {interval}"
            side = row["side"].replace("_", "-")
            table.add_row(side, difference, fixed(row["g"], 2, "+"), p_value(row["p_holm"]))
    return table
