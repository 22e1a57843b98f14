"""What follows from the results of a study: claims, statistics, figures and the report."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pandas as pd

from bilateral_rl.analysis.metric import Metric
from bilateral_rl.analysis.metrics import metrics_of
from bilateral_rl.claims import Judgement, evaluate_claims
from bilateral_rl.figures.saving import save
from bilateral_rl.io.files import replacing
from bilateral_rl.study.answer import Answer
from bilateral_rl.study.answer_drawing import draw_answer
from bilateral_rl.study.drawing import draw_study
from bilateral_rl.study.exhibits import Exhibits, Runs
from bilateral_rl.study.grid import Grid
from bilateral_rl.study.jobs import JobOutcome
from bilateral_rl.study.outcome import StudyResults, runs_of
from bilateral_rl.study.planning import seeds_of_components, seeds_table
from bilateral_rl.study.reading_tables import AnyReading
from bilateral_rl.study.report import Findings, Picture, write_report
from bilateral_rl.study.report_penalty import penalty_table
from bilateral_rl.study.report_table import ReportTable
from bilateral_rl.study.sides_table import sides_tables
from bilateral_rl.study.tables import study_tables
from bilateral_rl.study.trainings import Table
from bilateral_rl.study.two_arms.exhibits import exhibits_of_hands
from bilateral_rl.study.two_arms.judging import judge_hands
from bilateral_rl.study.two_arms.readings import HandReading

REPORT, RESULTS, CLAIMS, ANSWER, POWER = "report.html", "results.csv", "claims.csv", "answer.csv", "power.csv"

_FIRST_WORDS = (
    *("curve", "deep_minus_shallow", "hemispheres", "learning", "lesions", "models", "muscles", "pairs", "paths"),
    *(
        "penalty",
        "posthoc",
        "seeds",
        "sides",
        "specialization",
        "speed",
        "tests",
        "hands",
        "roles",
        "arms",
        "callosum",
        "learned",
    ),
)
"""How the names of a study's figures and tables begin."""
_SUFFIXES = (".csv", ".pdf", ".png")


def conclude(
    grid: Grid, folder: Path, outcomes: Sequence[JobOutcome], say: Callable[[str], None] = lambda _: None
) -> list[Judgement]:
    """Compute, draw and write everything that follows from the tables of results that are there.

    Tables and figures are of the trainings of the first reading, by its lesion protocol and those of the other anchors:
    of many they could not be read.

    Args:
        grid: the study's trainings under its readings.
        folder: folder of the study; results, claims, tables, figures and the report are written into it.
        outcomes: how its jobs ended.
        say: called with a few words on what is being done.

    Returns:
        The claims as each reading judges them.

    Raises:
        UserError: damaged or stale results, or a figure that cannot be written.
    """
    read = StudyResults(folder)
    say("computing the claims")
    judgements = [_judge(reading, grid, read) for reading in grid.readings]
    answer, shown = Answer(judgements), _shown(grid)
    configs = list(dict.fromkeys(table.training.config for table in shown))
    runs = {task: runs_of(folder, [t for t in shown if t.training.config.task == task]) for task in grid.study.tasks}
    exhibits = _exhibits(grid, read, shown, runs)
    tables = [seeds_table(answer), penalty_table(configs), *exhibits.tables, *sides_tables(runs)]
    _write(read.named(grid.all_tables), answer, tables, folder)
    say("drawing the figures")
    pictures = [
        Picture(save(drawing.figure, folder / "figures" / drawing.name)[0], drawing.caption)
        for drawing in (*draw_answer(answer), *exhibits.drawings)
    ]
    _remove_outdated(folder / "figures", [picture.png.stem for picture in pictures])
    say("writing the report")
    told = tables, pictures, exhibits.metrics, exhibits.radii
    write_report(Findings(grid.study, configs, outcomes, judgements, *told), folder / REPORT)
    return judgements


def _judge(reading: AnyReading, grid: Grid, read: StudyResults) -> Judgement:
    if isinstance(reading, HandReading):
        return judge_hands(reading, grid.tables_of(reading), read)
    claims = evaluate_claims(read.of(grid.tables_of(reading)), reading.criteria)
    return Judgement(reading.name, claims, reading.anchor, reading.choices, reading.why, reading.source)


def _exhibits(grid: Grid, read: StudyResults, shown: Sequence[Table], runs: Runs) -> Exhibits:
    """What the first reading's results are shown by."""
    first = grid.readings[0]
    if isinstance(first, HandReading):
        return exhibits_of_hands(first, shown, read, runs)
    results, radii = read.of(shown), {task: first.criteria.radii[task] for task in grid.study.tasks}
    drawings = draw_study(results, radii, runs)
    return Exhibits(list(study_tables(results, radii)), drawings, metrics_shown(radii), first.criteria.radii)


def metrics_shown(radii: Mapping[str, float]) -> list[Metric]:
    """Return the metrics of tasks at the radii of their goals (m), each once."""
    return list({metric.name: metric for task in radii for metric in metrics_of(task, [radii[task]])}.values())


def _shown(grid: Grid) -> list[Table]:
    """The tables of the first reading's trainings and lesions, by its protocol and by those of the other anchors."""
    first, *others = grid.readings
    readings = [first, *(reading for reading in others if reading.anchor is None)]
    protocols = {table.protocol for reading in readings for table in grid.tables_of(reading)}
    trainings = {table.training: table.lesions for table in grid.tables_of(first)}
    return [
        table
        for training, lesions in trainings.items()
        for table in grid.tables[training]
        if table.lesions == lesions and table.protocol in protocols
    ]


def _write(results: pd.DataFrame, answer: Answer, tables: Sequence[ReportTable], folder: Path) -> None:
    _csv(results, folder / RESULTS)
    _csv(pd.concat([claims_table(judgement) for judgement in answer.judgements], ignore_index=True), folder / CLAIMS)
    _csv(answer.table(), folder / ANSWER)
    _csv(seeds_of_components(answer), folder / POWER)
    (folder / "tables").mkdir(exist_ok=True)
    for table in tables:
        _csv(table.frame(), folder / "tables" / f"{table.name}.csv")
    _remove_outdated(folder / "tables", [table.name for table in tables])


def _remove_outdated(folder: Path, names: Sequence[str]) -> None:
    """Remove what an earlier call drew or wrote under names of ours that this one has nothing for."""
    ours = re.compile(f"({'|'.join(_FIRST_WORDS)})(_.*)?")
    for path in folder.glob("*.*"):
        if path.suffix in _SUFFIXES and ours.fullmatch(path.stem) and path.stem not in names:
            path.unlink()


def claims_table(judgement: Judgement) -> pd.DataFrame:
    """Return a table with a row for each component of a claim; those that stand beside it say how they are judged."""
    return pd.DataFrame(
        {
            "reading": judgement.reading,
            "claim": claim.number,
            "verdict": claim.verdict,
            "statement": claim.statement,
            "beside": beside,
            "component": component.text,
            "component_verdict": component.verdict,
            "quantity": component.quantity,
            "unit": component.unit,
            "estimate": component.estimate.value,
            "low": component.estimate.low,
            "high": component.estimate.high,
            "effect": component.effect.value,
            "effect_low": component.effect.low,
            "effect_high": component.effect.high,
            "test": component.test,
            "p": component.p,
            "p_tukey": component.tukey_p,
            "note": component.note,
            "no_better_than_fresh": ", ".join(component.relearned),
        }
        for claim in judgement.claims
        for beside, components in [("", claim.components), *((a.name, a.components) for a in claim.beside)]
        for component in components
    )


def _csv(table: pd.DataFrame, path: Path) -> None:
    with replacing(path) as temporary:
        table.to_csv(temporary, index=False)
