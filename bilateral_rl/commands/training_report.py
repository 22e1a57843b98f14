"""What was measured, as tables and lines for the terminal."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bilateral_rl.analysis.formats import mean_sd
from bilateral_rl.analysis.goals import in_centimeters
from bilateral_rl.analysis.modulation import SideModulation
from bilateral_rl.analysis.trial_records import TrialRecord, summaries
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.vocabulary import SIDES


def print_measures(records: Mapping[int, TrialRecord], config: TrainConfig, title: str, console: Console) -> None:
    """Print what trials of each seed's network came to; of two arms also what each hand did."""
    console.print(_measures_table(records, config, title))
    if any(record.n_arms > 1 for record in records.values()):
        console.print(_hands_table(records, config))


def _measures_table(records: Mapping[int, TrialRecord], config: TrainConfig, title: str) -> Table:
    """Measures at every reported goal radius: of the one seed, or mean ± standard deviation over the seeds."""
    table = Table("goal radius", title=escape(title), title_justify="left")
    for column in ("goal completion", "speed to goal", "time in goal"):
        table.add_column(column, justify="right")
    rows = [summaries(record, config.trial.threshold) for record in records.values()]
    for radius in rows[0]:
        values = [row[radius] for row in rows]
        own = "[bold]" if math.isclose(radius, config.trial.threshold) else ""
        table.add_row(
            f"{own}{in_centimeters(radius)} cm",
            f"{own}{_spread(values, 'goal_completion_percent', 1)} %",
            f"{own}{_speed_to_goal(values)}",
            f"{own}{_spread(values, 'time_in_goal_steps', 1)} of {config.trial.trial_length} steps",
        )
    values = [row[config.trial.threshold] for row in rows]
    table.caption = (
        f"final error {_spread(values, 'final_error_cm', 1)} cm; return: dominant "
        f"{_spread(values, 'return_dominant', 1)}, non-dominant {_spread(values, 'return_non_dominant', 1)}"
    )
    if len(records) > 1:
        table.caption += f"; mean ± standard deviation over {len(records)} seeds"
    return table


def _hands_table(records: Mapping[int, TrialRecord], config: TrainConfig) -> Table:
    """What each of two hands does in its role, at the run's own goal: mean ± standard deviation over the seeds."""
    radius = config.trial.threshold
    table = Table("hand", "role", title=f"By hand and role, within {in_centimeters(radius)} cm", title_justify="left")
    for column in ("goal completion", "speed to goal", "time in goal", "final error"):
        table.add_column(column, justify="right")
    of_seeds = [record.summaries_by_hand(radius) for record in records.values()]
    for hand, role in of_seeds[0]:
        values = [of_seed[hand, role] for of_seed in of_seeds]
        reaches = role == "reach"
        table.add_row(
            hand.replace("_", "-"),
            role,
            f"{_spread(values, 'goal_completion_percent', 1)} %" if reaches else "–",
            _speed_to_goal(values) if reaches else "–",
            f"{_spread(values, 'time_in_goal_steps', 1)} steps",
            f"{_spread(values, 'final_error_cm', 1)} cm",
        )
    return table


def sides_line(modulations: Mapping[int, SideModulation]) -> str:
    """Say what each side supplies to the commands: of the one seed, or mean ± standard deviation over the seeds."""
    rows = [modulation.measures() for modulation in modulations.values()]
    shares = [_spread(rows, f"contribution_percent_{side}", 0) for side in SIDES]
    constants = [_spread(rows, f"contribution_constant_{side}", 2) for side in SIDES]
    return (
        f"Sides: dominant {shares[0]} %, non-dominant {shares[1]} % of the commands' modulation; constant parts "
        f"{constants[0]} and {constants[1]}."
    )


def sides_table(modulations: Mapping[int, SideModulation]) -> Table:
    """What each side supplies to the commands: two rows a seed, and two for all, mean ± standard deviation."""
    title = "What each side supplies to the commands before the sigmoid"
    table = Table("seed", "side", title=title, title_justify="left")
    for column in ("share of modulation", "modulation", "constant part"):
        table.add_column(column, justify="right")
    of_seeds = {str(seed): [modulation.measures()] for seed, modulation in modulations.items()}
    of_all = {"all": [row for rows in of_seeds.values() for row in rows]} if len(of_seeds) > 1 else {}
    for name, rows in (of_seeds | of_all).items():
        for side in SIDES:
            table.add_row(
                name if side == SIDES[0] else "",
                side.replace("_", "-"),
                f"{_spread(rows, f'contribution_percent_{side}', 1)} %",
                _spread(rows, f"contribution_{side}", 2),
                _spread(rows, f"contribution_constant_{side}", 2),
                end_section=side == SIDES[1],
            )
    table.caption = (
        "Of a side's contribution over time and trials, modulation is the standard deviation and constant part the "
        "absolute value of the mean; both are means over the muscles."
    )
    return table


def _spread(values: list[dict[str, float]], name: str, decimals: int) -> str:
    return mean_sd([value[name] for value in values], decimals)


def _speed_to_goal(values: list[dict[str, float]]) -> str:
    reached = [value for value in values if not math.isnan(value["speed_to_goal_cm_per_step"])]
    return f"{_spread(reached, 'speed_to_goal_cm_per_step', 2)} cm/step" if reached else "–"
