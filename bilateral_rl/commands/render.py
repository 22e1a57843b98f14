"""`bilateral-rl render`."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import track

from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.commands.checks import check_trials
from bilateral_rl.config.catalogue import check_choice
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import INTACT, LESIONS
from bilateral_rl.runs.folder import FINAL
from bilateral_rl.video import files
from bilateral_rl.video.cast import Actor, common_trials, labels
from bilateral_rl.video.film import Film

MIN_SIZE = 320
"""Side of a picture in which captions can still be read (pixels)."""
MIN_FPS, MAX_FPS = 5, 50
"""Pictures a second that players show well; a picture is a step."""


def render(
    *,
    runs: Sequence[str],
    out: Path | None,
    trials: int,
    seed: int,
    lesion: str,
    weights: str,
    slow_down: int,
    size: int,
    console: Console,
) -> Path:
    """Write a video of networks that do the same trials, those that ``evaluate`` tests with the same seed.

    Args:
        runs: each RUN or RUN:SEED; of several seeds the first is shown if none is named.
        out: an .mp4 or .gif; None for :func:`default_path`. An earlier video of this command is replaced, and
            nothing else.
        trials: number of trials, one after another.
        seed: seed of the first trial; trial i is the first one of ``seed + i``.
        lesion: "intact" or a lesion of the paper (section 6), for every network.
        weights: which of each run's weights.
        slow_down: seconds of video for a second of the arm's time.
        size: side of each network's picture (pixels, even).
        console: where to print.

    Returns:
        The path of the video.

    Raises:
        UserError: runs that cannot be shown, or not together, or a file that cannot be written; none is left then.
    """
    _check_arguments(runs, trials, seed, lesion, size)
    actors = [Actor.load(run, weights) for run in runs]
    for actor in actors:
        actor.check_lesion(lesion)
    settings, notes = common_trials(actors)
    _check_speed(slow_down, settings.arm.timestep)
    path = out or default_path(actors, lesion, weights)
    files.check_path(path)
    evaluator = Evaluator(actors[0].config.task, settings, trials, seed)
    performances = [
        actor.perform(evaluator, lesion, settings.threshold, label)
        for actor, label in zip(actors, labels(actors, lesion), strict=True)
    ]
    film = Film(performances, slow_down, size)
    pictures = track(film, "drawing", console=console, transient=True, disable=not console.is_terminal)
    arguments = ["--trials", str(trials), "--seed", str(seed), "--lesion", lesion, "--weights", weights]
    files.write(path, film, pictures, shlex.join([*runs, *arguments]))
    for note in [*_seed_notes(actors), *notes]:
        console.print(f"[yellow]Note:[/yellow] {escape(note)}", soft_wrap=True, highlight=False)
    quoted = escape(shlex.quote(str(path)))
    console.print(f"Saved {len(film) / film.fps:.0f} s of video in [bold]{quoted}[/bold].", soft_wrap=True)
    return path


def default_path(actors: Sequence[Actor], lesion: str, weights: str) -> Path:
    """The default path of the video, beside the first run's folder: ``RUN[-seedN][+…][-weights][-lesion].mp4``."""
    unusual = [what for what, usual in ((weights, FINAL), (lesion, INTACT)) if what != usual]
    name = "-".join(["+".join(actor.name for actor in actors), *unusual])
    return actors[0].path.parent / f"{name}.mp4"


def _seed_notes(actors: Sequence[Actor]) -> list[str]:
    chosen = [f"{actor.path}:{actor.seed}" for actor in actors if actor.is_one_of_several]
    return [f"Of several seeds this shows the first: {', '.join(chosen)}."] if chosen else []


def _check_arguments(runs: Sequence[str], trials: int, seed: int, lesion: str, size: int) -> None:
    if not runs:
        raise UserError("render needs at least one run; `bilateral-rl list` shows those there are.")
    check_trials(trials, seed)
    if size < MIN_SIZE or size % 2:
        raise UserError(f"--size must be an even number of at least {MIN_SIZE} pixels, got {size}.")
    check_choice("lesion", lesion, [INTACT, *LESIONS])


def _check_speed(slow_down: int, timestep: float) -> None:
    least, most = math.ceil(1 / (MAX_FPS * timestep)), math.floor(1 / (MIN_FPS * timestep))
    if not least <= slow_down <= most:
        raise UserError(
            f"--slow-down must be from {least} to {most}, as a step of {1000 * timestep:g} ms is a picture and players "
            f"show {MIN_FPS} to {MAX_FPS} of them a second, got {slow_down}."
        )
