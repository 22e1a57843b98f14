"""Videos of trained models that do the same trials."""

from __future__ import annotations

import hashlib
import math
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bilateral_rl.analysis.conditions import Conditions
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.api.checks import as_path, check_tests, settings_by_name, whole
from bilateral_rl.api.notes import tell
from bilateral_rl.api.progress import ProgressLike, bar, console_of
from bilateral_rl.api.run import Run, find_run
from bilateral_rl.api.wording import in_python
from bilateral_rl.config.catalogue import check_choice
from bilateral_rl.config.parse import flat
from bilateral_rl.config.tasks import TaskWords
from bilateral_rl.envs.experiments.experiment import Experiment
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import INTACT, LESIONS
from bilateral_rl.runs.folder import FINAL
from bilateral_rl.video import files
from bilateral_rl.video.cast import Actor, common_trials, labels, told_apart, unusual_trials
from bilateral_rl.video.film import Film, Picture
from bilateral_rl.vocabulary import TEST_SEED

MIN_SIZE = 320
"""Side of a picture in which captions can still be read (pixels)."""
MAX_WORDS = 80
"""Characters of a file's name that say what is unusual in the trials; a digest says the rest."""
MIN_FPS, MAX_FPS = 5, 50
"""Pictures a second that players show well; a picture is a step."""


@dataclass(frozen=True)
class Video:
    """A video that was written."""

    path: Path
    """The file."""
    seconds: float
    """How long it is."""
    notes: tuple[str, ...] = ()
    """Sentences that a person should read."""


@in_python
def render(
    *runs: Run | str | Path,
    out: str | Path | None = None,
    trials: int = 4,
    seed: int = TEST_SEED,
    lesion: str = INTACT,
    weights: str = FINAL,
    slow_down: int = 4,
    size: int = 480,
    task: TaskWords | None = None,
    settings: Mapping[str, Any] | None = None,
    progress: ProgressLike = True,
) -> Path:
    """Make a video of trained models that do the same trials side by side, muscles colored by activation.

    The trials are those that :meth:`Run.evaluate` tests with the same seed. What a person should know is a warning.

    Args:
        runs: one or several, loaded or as :func:`load` takes them; of several seeds the first is shown.
        out: an .mp4 or .gif file; None for one beside the first run's folder. An earlier video is replaced, and nothing
            else.
        trials: how many, one after another.
        seed: seed of the first trial.
        lesion: "intact", or the name of a lesion, for every network.
        weights: "final", "best" or "step_…": which of the runs' weights.
        slow_down: seconds of video for a second of the arm's.
        size: height of each network's picture (pixels, even), and its width where there is one arm.
        task: another task than the runs', which may then have learned different ones; an experiment or its file; or
            the runs' own class, as "module:Class".
        settings: other settings of trials than the runs', such as ``{"trial.two_arms.spring.stiffness": 0}``.
        progress: whether a bar shows how it comes along, or the rich console where it does.

    Returns:
        The path of the video; in a notebook, ``IPython.display.Video(path, embed=True)`` shows it.

    Raises:
        UserError: runs that cannot be shown, or not together, or a file that cannot be written; none is left then.
    """
    changed = settings_by_name("--set", settings)
    video = make_video(runs, out, trials, seed, lesion, weights, slow_down, size, task, changed, progress)
    tell(video.notes)
    return video.path


def make_video(
    runs: Sequence[Run | str | Path],
    out: str | Path | None,
    trials: int,
    seed: int,
    lesion: str,
    weights: str,
    slow_down: int,
    size: int,
    task: TaskWords | None,
    settings: Mapping[str, Any],
    progress: ProgressLike,
) -> Video:
    """Make a video (:func:`render`); settings are nested dictionaries. Raises UserError for one that cannot be."""
    trials, seed = check_tests(trials, seed)
    _check_arguments(runs, lesion, size := whole("--size", size))
    console_of(progress)  # refused before anything is simulated
    actors = [Actor.load(find_run(run).name, weights) for run in runs]
    for actor in actors:
        actor.check_lesion(lesion)
    for name, _ in flat(settings):
        if name.startswith("trial.losses."):
            raise UserError(f"{name} changes nothing in a film, which shows no rewards: leave it out.")
    under, notes = common_trials(actors, task, settings)
    _check_speed(slow_down := whole("--slow-down", slow_down), under.settings.arm.timestep)
    path = default_path(actors, under, lesion, weights) if out is None else as_path("--out", out)
    files.check_path(path)
    shown = under.config.make_task()
    evaluator = Evaluator(shown, under.settings, trials + trials % shown.n_arms, seed)
    performances = [
        actor.perform(evaluator, lesion, under.settings.threshold, label)
        for actor, label in zip(actors, labels(actors, lesion, under), strict=True)
    ]
    film = Film(performances, slow_down, size, trials)
    arguments = ["--trials", str(trials), "--seed", str(seed), "--lesion", lesion, "--weights", weights]
    arguments += ["--slow-down", str(slow_down), "--size", str(size), *_conditions_as_options(task, settings)]
    names = [find_run(run).name for run in runs]
    files.write(path, film, _counted(film, progress), shlex.join([*names, *arguments]))
    return Video(path, len(film) / film.fps, (*_seed_notes(actors), *notes))


def _conditions_as_options(task: TaskWords | None, settings: Mapping[str, Any]) -> Iterator[str]:
    if task is not None:
        yield from ("--task", task.name if isinstance(task, Experiment) else str(task))
    for name, value in flat(settings):
        yield from ("--set", f"{name}={value}")


def default_path(actors: Sequence[Actor], under: Conditions, lesion: str, weights: str) -> Path:
    """Return the default path of the video, beside the first run.

    It is ``RUN[-seed-N][+…][-weights][-lesion][-task][-setting=value…].mp4``, each run after the folders above it where
    runs of one name are others.
    """
    seeds = ["" if actor.named_seed is None else f"-seed-{actor.named_seed}" for actor in actors]
    runs = [f"{name.replace('/', '-')}{seed}" for name, seed in zip(told_apart(actors), seeds, strict=True)]
    unusual = [what for what, usual in ((weights, FINAL), (lesion, INTACT)) if what != usual]
    name = "-".join(["+".join(runs), *unusual, *_as_file_name(unusual_trials(actors, under))])
    return actors[0].path.parent / f"{name}.mp4"


def _as_file_name(words: Sequence[str]) -> list[str]:
    """Return what is unusual in characters that any system allows, as one word or none, with a digest if it is long."""
    name = re.sub(r"[^\w.=+-]+", "_", "-".join(words))
    digest = hashlib.sha256(name.encode()).hexdigest()[:8]
    return [name if len(name) <= MAX_WORDS else f"{name[:MAX_WORDS]}-{digest}"] if name else []


def _counted(film: Film, progress: ProgressLike) -> Iterator[Picture]:
    with bar(progress, "drawing", len(film)) as advance:
        for i, picture in enumerate(film):
            yield picture
            advance(i + 1, "")


def _seed_notes(actors: Sequence[Actor]) -> list[str]:
    chosen = [f"{actor.path}:{actor.seed}" for actor in actors if actor.is_one_of_several]
    return [f"Of several seeds this shows the first: {', '.join(chosen)}."] if chosen else []


def _check_arguments(runs: Sequence[Run | str | Path], lesion: str, size: int) -> None:
    if not runs:
        raise UserError("render needs at least one run; `bilateral-rl list` shows those there are.")
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
