"""The whole paper: every training, its lesions, the statistics, the figures and the report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd

from bilateral_rl.analysis.goals import JUDGED_RADII
from bilateral_rl.claims import Claim, evaluate_claims
from bilateral_rl.figures.saving import save
from bilateral_rl.io.files import replacing
from bilateral_rl.study.drawing import draw_study
from bilateral_rl.study.jobs import JobOutcome
from bilateral_rl.study.outcome import results_of, runs_of
from bilateral_rl.study.plan import Study
from bilateral_rl.study.report import Findings, Picture, write_report
from bilateral_rl.study.report_table import ReportTable
from bilateral_rl.study.tables import study_tables

REPORT, RESULTS, CLAIMS = "report.html", "results.csv", "claims.csv"


def conclude(
    study: Study, folder: Path, outcomes: Sequence[JobOutcome], say: Callable[[str], None] = lambda _: None
) -> list[Claim]:
    """Compute, draw and write everything that follows from the trainings that are done.

    Args:
        study: the study whose trainings they are.
        folder: folder of the study; results, claims, tables, figures and the report are written into it.
        outcomes: how its jobs ended.
        say: called with a few words on what is being done.

    Returns:
        The claims with their verdicts.

    Raises:
        UserError: damaged or stale results, or a figure that cannot be written.
    """
    configs = study.configs()
    results = results_of(folder, configs)
    say("computing the claims")
    claims = evaluate_claims(results, JUDGED_RADII)
    tables = list(study_tables(results, JUDGED_RADII))
    _write(results, claims, tables, folder)
    say("drawing the figures")
    runs = {task: runs_of(folder, [config for config in configs if config.task == task]) for task in JUDGED_RADII}
    pictures = [
        Picture(save(drawing.figure, folder / "figures" / drawing.name)[0], drawing.caption)
        for drawing in draw_study(results, JUDGED_RADII, runs)
    ]
    say("writing the report")
    write_report(Findings(study, configs, outcomes, claims, tables, pictures), folder / REPORT)
    return claims


def _write(results: pd.DataFrame, claims: Sequence[Claim], tables: Sequence[ReportTable], folder: Path) -> None:
    _csv(results, folder / RESULTS)
    _csv(_claims_table(claims), folder / CLAIMS)
    (folder / "tables").mkdir(exist_ok=True)
    for table in tables:
        _csv(table.frame(), folder / "tables" / f"{table.name}.csv")


def _claims_table(claims: Sequence[Claim]) -> pd.DataFrame:
    """A table with a row for each component of a claim."""
    return pd.DataFrame(
        {
            "claim": claim.number,
            "verdict": claim.verdict,
            "statement": claim.statement,
            "component": component.text,
            "component_verdict": component.verdict,
            "quantity": component.quantity,
            "unit": component.unit,
            "estimate": component.estimate.value,
            "low": component.estimate.low,
            "high": component.estimate.high,
            "test": component.test,
            "p": component.p,
            "p_tukey": component.tukey_p,
        }
        for claim in claims
        for component in claim.components
    )


def _csv(table: pd.DataFrame, path: Path) -> None:
    with replacing(path) as temporary:
        table.to_csv(temporary, index=False)
