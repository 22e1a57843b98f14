"""What people see on the terminal: how a training comes along, and what was measured."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from bilateral_rl.analysis.formats import mean_sd
from bilateral_rl.analysis.goals import in_centimeters
from bilateral_rl.analysis.modulation import SideModulation
from bilateral_rl.analysis.trials import TrialRecord, summaries
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.io.text import seed_range
from bilateral_rl.training import progress
from bilateral_rl.vocabulary import SIDES


class TrainingProgress(progress.Progress):
    """A bar with the remaining time and the present goal completion; lines where there is no terminal."""

    def __init__(self, config: TrainConfig, console: Console) -> None:
        self._config, self._console = config, console
        self._draws = console.is_terminal and not console.is_dumb_terminal
        self._bar = Progress(
            TextColumn("[bold]training"),
            BarColumn(),
            TaskProgressColumn(),
            TimeRemainingColumn(),
            TextColumn("left"),
            TextColumn("{task.fields[goal]}"),
            TextColumn("{task.fields[speed]}"),
            console=console,
            disable=not self._draws,
        )
        self._task = self._bar.add_task("train", total=config.total, start=False, speed="", goal="")
        self._announced = False

    def __enter__(self) -> TrainingProgress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._announced:
            self._bar.stop()

    def announce(self) -> None:
        """Say what begins, at the latest when it does; before that, it may still be refused."""
        if not self._announced:
            self._announced = True
            self._console.print(training_title(self._config))
            self._bar.start()

    def on_start(self, done: int) -> None:
        self.announce()
        self._bar.reset(self._task, completed=done)

    def on_step(self, done: int) -> None:
        speed = self._bar.tasks[self._task].speed
        self._bar.update(self._task, completed=done, speed=self._speed(speed) if speed else "")

    def on_stop(self) -> None:
        self._console.print("Stopping; saving first. Ctrl-C again stops at once, without what is not saved yet.")

    def on_evaluation(self, done: int, measures: dict[str, float]) -> None:
        goal = f"goal {measures['goal_completion_percent']:.0f} %"
        where = f"{done:>12,} steps"
        if "seed" in measures:  # one of several trainings side by side
            where = f"{where} of all seeds, seed {measures['seed']:.0f}"
            goal = f"seed {measures['seed']:.0f}, {goal}" if self._draws else goal
        if "epoch" in measures:
            training = f"{measures['seeds_training']:.0f} of {self._config.seeds} seeds training"
            where = f"epoch {measures['epoch']:>3.0f}, {training}, validation loss {measures['validation_loss']:.3f}"
            goal = f"epoch {measures['epoch']:.0f}, {training}, {goal}" if self._draws else goal
        self._bar.update(self._task, goal=goal)
        if not self._draws:
            inside = f"{measures['time_in_goal_steps']:.0f} steps in goal"
            error = f"final error {measures['final_error_cm']:.1f} cm"
            self._console.print(f"{where}: {goal}, {inside}, {error}", highlight=False, soft_wrap=True)

    def _speed(self, speed: float) -> str:
        if self._config.unit == "updates":
            return f"{speed:.0f} updates/s"
        return f"{speed / 1000:.0f} k steps/s"


def training_title(config: TrainConfig) -> str:
    """Say what a training is about to do, with markup."""
    seeds = seed_range(config.all_seeds) + (" side by side" if config.seeds > 1 else "")
    what = f"[bold]{config.model}[/bold] learns [bold]{config.task}[/bold] by {config.algo}"
    return f"{what}: {config.plan}, {seeds}. Ctrl-C stops and saves."


def measures_table(records: Mapping[int, TrialRecord], config: TrainConfig, title: str) -> Table:
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
    reached = [value for value in values if value["speed_to_goal_cm_per_step"] > 0]
    # nan: never reached; 0: a hold starts there
    return f"{_spread(reached, 'speed_to_goal_cm_per_step', 2)} cm/step" if reached else "–"
