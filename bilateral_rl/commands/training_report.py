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
from bilateral_rl.vocabulary import SIDES, path_names


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
    reaches = any((record.plan.role == "reach").any() for record in records.values())  # any network completes a hold
    for radius in rows[0]:
        values = [row[radius] for row in rows]
        own = "[bold]" if math.isclose(radius, config.trial.threshold) else ""
        table.add_row(
            f"{own}{in_centimeters(radius)} cm",
            f"{own}{_spread(values, 'goal_completion_percent', 1)} %" if reaches else "–",
            f"{own}{_speed_to_goal(values)}" if reaches else "–",
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
    for column in ("goal completion", "time in goal", "final error"):
        table.add_column(column, justify="right")
    of_seeds = [record.summaries_by_hand(radius) for record in records.values()]
    for hand, role in of_seeds[0]:
        values = [of_seed[hand, role] for of_seed in of_seeds]
        table.add_row(
            hand.replace("_", "-"),
            role,
            f"{_spread(values, 'goal_completion_percent', 1)} %" if role == "reach" else "–",
            f"{_spread(values, 'time_in_goal_steps', 1)} steps",
            f"{_spread(values, 'final_error_cm', 1)} cm",
        )
    return table


def sides_line(modulations: Mapping[int, SideModulation]) -> str:
    """Say what each side supplies to the commands: of the one seed, or mean ± standard deviation over the seeds.

    Of two arms there is a line for each.
    """
    rows = [modulation.measures() for modulation in modulations.values()]
    lines = []
    for arm, names in _paths(modulations).items():
        shares = [_spread(rows, f"contribution_percent_{name}", 0) for name in names]
        constants = [_spread(rows, f"contribution_constant_{name}", 2) for name in names]
        lines.append(
            f"{f'Sides, {arm} arm' if arm else 'Sides'}: dominant {shares[0]} %, non-dominant {shares[1]} % of the "
            f"commands' modulation; constant parts {constants[0]} and {constants[1]}."
        )
    return "\n".join(lines)


def sides_table(modulations: Mapping[int, SideModulation]) -> Table:
    """What each side supplies to the commands: two rows a seed, and two for all, mean ± standard deviation.

    Of two arms these are rows of each.
    """
    title = "What each side supplies to the commands before the sigmoid"
    arms = _paths(modulations)
    table = Table("seed", *(["arm"] if len(arms) > 1 else []), "side", title=title, title_justify="left")
    for column in ("share of modulation", "modulation", "constant part"):
        table.add_column(column, justify="right")
    of_seeds = {str(seed): [modulation.measures()] for seed, modulation in modulations.items()}
    of_all = {"all": [row for rows in of_seeds.values() for row in rows]} if len(of_seeds) > 1 else {}
    for name, rows in (of_seeds | of_all).items():
        for i, (arm, paths) in enumerate(arms.items()):
            for side, path in zip(SIDES, paths, strict=True):
                first = side == SIDES[0]
                table.add_row(
                    name if first and i == 0 else "",
                    *([arm if first else ""] if len(arms) > 1 else []),
                    side.replace("_", "-"),
                    f"{_spread(rows, f'contribution_percent_{path}', 1)} %",
                    _spread(rows, f"contribution_{path}", 2),
                    _spread(rows, f"contribution_constant_{path}", 2),
                    end_section=not first and i == len(arms) - 1,
                )
    table.caption = (
        "Of a side's contribution over time and trials, modulation is the standard deviation and constant part the "
        "absolute value of the mean; both are means over the muscles."
    )
    return table


def _paths(modulations: Mapping[int, SideModulation]) -> dict[str, list[str]]:
    """Return what the measures of both sides are called, by the name of the arm, which is empty of a single one."""
    n_arms = next(iter(modulations.values())).n_arms
    names = [path.replace("/", "_") for path in path_names(n_arms)]
    if n_arms == 1:
        return {"": names}
    return {arm.replace("_", "-"): [name for name in names if name.startswith(f"{arm}_arm_")] for arm in SIDES}


def _spread(values: list[dict[str, float]], name: str, decimals: int) -> str:
    return mean_sd([value[name] for value in values], decimals)


def _speed_to_goal(values: list[dict[str, float]]) -> str:
    reached = [value for value in values if not math.isnan(value["speed_to_goal_cm_per_step"])]
    return f"{_spread(reached, 'speed_to_goal_cm_per_step', 2)} cm/step" if reached else "–"
