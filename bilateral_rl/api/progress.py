"""How long things take, shown where the call is made: on a terminal, in a notebook, or nowhere."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

from rich.console import Console
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn

from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.io.bars import Bars, draws
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.terminal import Terminal
from bilateral_rl.io.text import seed_range
from bilateral_rl.training import progress

ProgressLike = bool | Console
"""Whether to show progress, or the rich console where it is shown."""
Advance = Callable[[int, str], None]
"""Called with how much of the total is done, and with what comes next."""


def console_of(shown: ProgressLike) -> Console | None:
    """Return where progress is shown: by default standard error, or a notebook's cell; None for nowhere."""
    if isinstance(shown, Console):
        return shown
    if not isinstance(shown, bool):
        raise UserError(f"--progress must be True, False or a console of rich, got {shown!r}.")
    return Terminal(stderr=True) if shown else None


@contextlib.contextmanager
def bar(shown: ProgressLike, description: str, total: int) -> Iterator[Advance]:
    """A context with a bar that vanishes at its end; it is advanced by calling what it gives."""
    console = console_of(shown)
    if console is None:
        yield lambda done, what: None
        return
    with Bars(TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn(),
              console=console, transient=True) as bars:  # fmt: skip
        task = bars.add_task(description, total=total)

        def advance(done: int, what: str) -> None:
            bars.update(task, completed=done, description=what or description)

        yield advance


class TrainingProgress(progress.Progress):
    """A bar with the remaining time and the measure that the task is judged by; lines where there is no terminal."""

    def __init__(self, config: TrainConfig, console: Console) -> None:
        self._config, self._console = config, console
        self._draws = draws(console)
        self._bar = Bars(
            TextColumn("[bold]training"),
            BarColumn(),
            TaskProgressColumn(),
            TimeRemainingColumn(),
            TextColumn("left"),
            TextColumn("{task.fields[goal]}"),
            TextColumn("{task.fields[speed]}"),
            console=console,
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
            self._console.print(training_title(self._config, self._console.is_jupyter), highlight=False)
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
        goal = self._judged(measures)
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
            error = f"final error {measures['final_error_cm']:.1f} cm"
            self._console.print(f"{where}: {goal}, {error}", highlight=False, soft_wrap=True)

    def _judged(self, measures: dict[str, float]) -> str:
        """Say how well the task is done; a hold starts in the goal, so that any network completes it."""
        inside = f"{measures['time_in_goal_steps']:.0f}"
        if self._config.judged_by == "time_in_goal":
            return f"{inside} of {self._config.trial.trial_length} steps in goal"
        goal = f"goal {measures['goal_completion_percent']:.0f} %"
        return goal if self._draws else f"{goal}, {inside} steps in goal"

    def _speed(self, speed: float) -> str:
        if self._config.unit == "updates":
            return f"{speed:.0f} updates/s"
        return f"{speed / 1000:.0f} k steps/s"


def training_title(config: TrainConfig, in_notebook: bool = False) -> str:
    """Say what a training is about to do, with markup."""
    seeds = seed_range(config.all_seeds) + (" side by side" if config.seeds > 1 else "")
    what = f"[bold]{config.model}[/bold] learns [bold]{config.task}[/bold] by {config.algo}"
    stop = "Interrupting the kernel" if in_notebook else "Ctrl-C"
    return f"{what}: {config.plan}, {seeds}. {stop} stops and saves."
