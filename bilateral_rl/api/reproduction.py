"""A whole study: every training, its lesions, the statistics, the figures, and a report with verdicts."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from bilateral_rl.api.checks import Names, SeedsLike, as_path, flag, names, seeds_text, settings_by_name, whole
from bilateral_rl.api.jobs import notes_on, run_jobs
from bilateral_rl.api.notes import tell
from bilateral_rl.api.progress import ProgressLike, console_of
from bilateral_rl.api.wording import in_python
from bilateral_rl.claims import Judgement
from bilateral_rl.claims.margins import PAPER_SEEDS
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.config.parse import Values
from bilateral_rl.config.seeds import Seeds, parse_seeds
from bilateral_rl.study.agenda import Step, agenda
from bilateral_rl.study.answer import Answer
from bilateral_rl.study.answer_in_words import notes_in_words, unjudged_in_words
from bilateral_rl.study.fit import readings_for
from bilateral_rl.study.folder import claimed_folder
from bilateral_rl.study.grid import Grid
from bilateral_rl.study.jobs import JobOutcome
from bilateral_rl.study.outcome import refuse_other_settings, unsourced
from bilateral_rl.study.plan import QUICK_SEEDS, Study, as_subject, side_by_side
from bilateral_rl.study.report import counts_of
from bilateral_rl.study.reproduction import REPORT, claims_table, conclude


@dataclass(frozen=True)
class Reproduction:
    """What came of a study of the paper, or of two arms; all of it is in its folder, as files too."""

    folder: Path
    """The study's folder, with tables, figures and runs."""
    judgements: Sequence[Judgement]
    """The claims as each reading judges them."""
    outcomes: Sequence[JobOutcome]
    """How its trainings ended."""
    unsourced: Sequence[Path] = ()
    """Results that do not say which weights they are of, as those of earlier versions."""

    @property
    def report(self) -> Path:
        """The report, an HTML file."""
        return self.folder / REPORT

    @property
    def verdicts(self) -> pd.DataFrame:
        """A row a reading and claim, with ``verdict`` and the component that decides it (``answer.csv``)."""
        return Answer(self.judgements).table()

    @property
    def claims(self) -> pd.DataFrame:
        """A row a component of a claim, with its estimate, effect and test (``claims.csv``)."""
        return pd.concat([claims_table(judgement) for judgement in self.judgements], ignore_index=True)

    @property
    def unjudged(self) -> str:
        """Which claims no reading can judge for want of results, in a sentence; empty if there are none."""
        return unjudged_in_words(Answer(self.judgements))

    @property
    def notes(self) -> str:
        """What must be known before any verdict is read, such as that no network learned; empty if nothing."""
        return notes_in_words(Answer(self.judgements))

    def __repr__(self) -> str:
        lines = [f"{judgement.reading}: {counts_of(judgement.claims)}" for judgement in self.judgements]
        return "\n".join([f"Reproduction({str(self.report)!r})", *lines])


@dataclass(frozen=True)
class Plan:
    """A study that nothing stands against, before it begins."""

    grid: Grid
    """Its trainings under its readings."""
    folder: Path
    """Its folder."""
    at_once: int
    """Number of trainings at a time."""
    left_out: Sequence[str]
    """Names of the readings that its algorithm and profile leave no room for."""

    @property
    def study(self) -> Study:
        """What it is of."""
        return self.grid.study

    @property
    def steps(self) -> list[Step]:
        """What is left to do, and what that costs."""
        return agenda(self.grid, self.folder)


@in_python
def reproduce(
    algo: str = "bptt",
    profile: str = "paper",
    models: Names = None,
    *,
    study: str = "paper",
    tasks: Names = None,
    seeds: SeedsLike = None,
    quick: bool = False,
    jobs: int | None = None,
    ray: str | None = None,
    settings: Mapping[str, Any] | None = None,
    readings: Names = None,
    out: str | Path | None = None,
    progress: ProgressLike = True,
) -> Reproduction:
    """Reproduce the paper: train, lesion and test seven models on two tasks, judge its claims, and write a report.

    Or do the same for the study of two arms that one brain controls, whose claims are B1 to B6.

    It takes hours, or minutes if ``quick``. Called again, it goes on where it was. A training that fails stops no
    other, and is a warning.

    Args:
        algo: "bptt", as the paper, or "ppo", "a2c", "sac" or "td3".
        profile: "paper", or "released" for the losses and lesions of its code.
        models: one or several; None for all.
        study: "paper", or "two_arms".
        tasks: one or several of the study's; None for all.
        seeds: networks of each model: how many, of seeds 0 and up; or which, as ``range(100, 130)``. None for 10, or 3
            if ``quick``.
        quick: a preview: 3 seeds, short trainings.
        jobs: trainings at a time; None for one a CPU.
        ray: address of a Ray cluster, or "local"; None for this machine without Ray.
        settings: settings of every training, such as ``{"bptt.learning_rate": 0.01}``.
        readings: readings to judge by: "all", names, or YAML files; None for "text" and "everything", or, of two arms,
            all that need no other trainings.
        out: folder of the study; None for one below ``runs`` that is named for what it is of.
        progress: whether bars show how it comes along, or the rich console where they do.

    Returns:
        The claims with their verdicts as tables, and where the report is.

    Raises:
        UserError: a study that cannot be made, or not there.
        Stopped: somebody interrupted it.
    """
    folder = None if out is None else as_path("--out", out)
    fixed, chosen = settings_by_name("--set", settings), names("--readings", readings)
    of = algo, profile, names("--models", models), seeds_text(seeds), quick, jobs, fixed, chosen, folder
    plan = make_plan(*of, study, names("--tasks", tasks))
    made = run_plan(plan, ray, progress)
    tell([*filter(None, [made.notes, made.unjudged]), *notes_on(made.outcomes, made.unsourced)])
    return made


def make_plan(
    algo: str,
    profile: str,
    models: Sequence[str] | None,
    seeds: str | None,
    quick: bool,
    n_jobs: int | None,
    settings: Values,
    readings: Sequence[str] | None,
    folder: Path | None,
    subject: str = "paper",
    tasks: Sequence[str] | None = None,
) -> Plan:
    """Refuse a study that cannot be, and say what it comes to.

    Args:
        algo: the algorithm of every training.
        profile: "paper", or "released".
        models: which models; None for all.
        seeds: networks of each model, as ``--seeds`` takes them; None for the usual number of them.
        quick: whether it is a preview.
        n_jobs: number of trainings at a time; None for one a CPU.
        settings: of every training, as nested dictionaries.
        readings: readings, as ``--readings`` takes them; None for the usual ones.
        folder: of the study; None for one below ``runs``.
        subject: what it is about, "paper" or "two_arms".
        tasks: names of tasks; None for all of them.

    Raises:
        UserError: it cannot be.
    """
    study = _study(algo, profile, models, seeds, flag("--quick", quick), settings, subject, tasks)
    chosen, left_out = readings_for(study, readings)
    n_jobs = None if n_jobs is None else whole("--jobs", n_jobs, least=1)
    at_once, threads = side_by_side(n_jobs, len(Grid(study, chosen).tables), algo)
    return Plan(Grid(study, chosen, threads), folder or Path("runs") / study.name, at_once, left_out)


def run_plan(
    plan: Plan, ray: str | None, progress: ProgressLike, announce: Callable[[], None] = lambda: None
) -> Reproduction:
    """Do what is left of a study, and conclude from it.

    Args:
        plan: the study.
        ray: address of a Ray cluster; None for this machine.
        progress: whether, or where, to show how it comes along.
        announce: called before the first training, once nothing stands against it.

    Raises:
        UserError: a folder of another study, or a cluster that is not there.
        Stopped: somebody interrupted it.
    """
    grid, folder = plan.grid, plan.folder
    with claimed_folder(folder, plan.study.to_values()):
        refuse_other_settings(folder, grid.all_tables)
        announce()
        outcomes = run_jobs(
            grid.jobs(folder), folder, title=plan.study.name, at_once=plan.at_once, ray=ray, progress=progress
        )
        with _saying(progress) as say:
            judgements = conclude(grid, folder, outcomes, say)
    return Reproduction(folder, judgements, outcomes, unsourced(folder / table.path for table in grid.all_tables))


def _study(
    algo: str,
    profile: str,
    models: Sequence[str] | None,
    seeds: str | None,
    quick: bool,
    settings: Values,
    subject: str,
    tasks: Sequence[str] | None,
) -> Study:
    if seeds is None:
        chosen = Seeds(QUICK_SEEDS if quick else PAPER_SEEDS)
    else:
        chosen = parse_seeds(seeds, "--set seed" if "seed" in settings else "")
    requested = models or MODELS
    in_order = dict.fromkeys([*(model for model in MODELS if model in requested), *requested])
    about = as_subject(subject), tuple(tasks or ())
    return Study(algo, profile, chosen.first or 0, chosen.n, quick, settings, tuple(in_order), *about)


@contextlib.contextmanager
def _saying(progress: ProgressLike) -> Iterator[Callable[[str], None]]:
    """A context that gives what shows a few words on what is being done."""
    console = console_of(progress)
    if console is None or console.is_jupyter:
        yield lambda text: None
        return
    with console.status("concluding") as status:
        yield lambda text: status.update(f"{text} …")
