"""A study's report: one page that needs nothing else, not even a network."""

from __future__ import annotations

import base64
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jinja2
import yaml

from bilateral_rl.analysis.metric import Metric
from bilateral_rl.claims import Claim, Judgement
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.figures.labels import model_label, task_label
from bilateral_rl.io.files import replacing
from bilateral_rl.runs.versions import versions
from bilateral_rl.study.answer import Answer
from bilateral_rl.study.answer_in_words import CONFIRMING, EXPLORING, nothing_judged, unjudged_in_words
from bilateral_rl.study.calibration import CALIBRATED_FOR
from bilateral_rl.study.jobs import JobOutcome, JobState
from bilateral_rl.study.plan import Study, is_supervised
from bilateral_rl.study.planning import demand_in_words
from bilateral_rl.study.report_answer import answer_values
from bilateral_rl.study.report_penalty import penalty_in_words
from bilateral_rl.study.report_table import ReportTable
from bilateral_rl.study.words import WORDS

LOG_LINES, LOG_BYTES = 25, 2**16
"""Largest part of a log that is shown, from its end."""


@dataclass(frozen=True)
class Picture:
    """A figure in a file."""

    png: Path
    caption: str


@dataclass(frozen=True)
class Findings:
    """Everything that a report tells."""

    study: Study
    configs: Sequence[TrainConfig]
    outcomes: Sequence[JobOutcome]
    judgements: Sequence[Judgement]
    tables: Sequence[ReportTable]
    pictures: Sequence[Picture]
    metrics: Sequence[Metric]
    """What tables and figures show."""
    radii: Mapping[str, float] = field(default_factory=dict)
    """Radius of the goal by task (m), in tables and figures: that of the first reading of the paper."""

    @property
    def claims(self) -> Sequence[Claim]:
        """The claims as the first reading judges them."""
        return self.judgements[0].claims


def write_report(findings: Findings, path: Path) -> None:
    """Write the page, whole or not at all. Raises OSError if it cannot be written."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("bilateral_rl.study", ""), autoescape=True, undefined=jinja2.StrictUndefined
    )
    page = environment.get_template("report.html.jinja").render(_values(findings))
    with replacing(path) as temporary:
        temporary.write_text(page, encoding="utf-8")


def counts_of(claims: Sequence[Claim]) -> str:
    """Count the claims of each verdict, in a sentence."""
    counts: Counter[str] = Counter(claim.verdict for claim in claims)
    names = ("supported", "not supported", "undecided")
    return f"Of {len(claims)} claims: " + ", ".join(f"{counts[name]} {name}" for name in names) + "."


def _values(findings: Findings) -> dict[str, Any]:
    study, answer = findings.study, Answer(findings.judgements)
    words = WORDS[study.subject]
    return {
        "title": f"{words.title}, by {study.algo}",
        "subtitle": _subtitle(findings),
        "preview": f"{study.seeds} seeds, short trainings and few test trials" if study.quick else "",
        **answer_values(answer, words),
        "purpose": CONFIRMING if study.purpose == "confirmation" else EXPLORING,
        "demand": demand_in_words,
        "details": [_detail(anchor, told=nothing_judged(answer)) for anchor in answer.anchors],
        "calibrated": CALIBRATED_FOR if study.is_calibrated else (),
        "nothing": nothing_judged(answer),
        "unjudged": "" if nothing_judged(answer) else unjudged_in_words(answer),
        "rule": words.rule,
        "lesions": words.lesions,
        "metrics": findings.metrics,
        "tables": findings.tables,
        **_figures(findings.pictures),
        "jobs": [_job(outcome) for outcome in findings.outcomes],
        "jobs_summary": _jobs_summary(findings.outcomes, study.seeds if is_supervised(study.algo) else 1),
        "setup": _setup(findings),
        "blocks": _blocks(findings),
    }


def _detail(judgement: Judgement, *, told: bool) -> dict[str, Any]:
    """A reading's claims; its note, unless the answer told it at once."""
    claims = judgement.claims
    return {
        "name": judgement.reading,
        "why": judgement.why,
        "counts": counts_of(claims),
        "claims": claims,
        "note": "" if told else judgement.note,
    }


def _subtitle(findings: Findings) -> str:
    study, radii = findings.study, findings.radii
    trained = f"profile {study.profile}, " if study.algo == "bptt" else ""
    names = [model_label(model) for model in study.models]
    models = f"{len(names)} of seven models ({', '.join(names)})" if len(names) < len(MODELS) else "seven models"
    networks = f"{trained}{study.seeds} seeds each"
    if study.subject == "two_arms":
        tasks = ", ".join(task_label(task).lower() for task in study.tasks)
        return (
            f"The task of Woytowicz, Westlake, Whitall & Sainburg 2018 (doi:10.1152/jn.00878.2017): {models} on "
            f"{tasks}, {networks}. Verdicts are computed from the results."
        )
    where = f" under “{findings.judgements[0].reading}”" if len(findings.judgements) > 1 else ""
    on = "two tasks" if len(study.tasks) > 1 else task_label(study.tasks[0]).lower()
    return (
        f"Rinaldo, Friedman, Kuhlmann & Kowadlo, arXiv 2401.14057: {models} on {on}, {networks}. "
        f"Goal radius{where}: reach {100 * radii['random_reach']:g} cm, "
        f"hold {100 * radii['hold_position']:g} cm. Verdicts are computed from the results."
    )


def _figures(pictures: Sequence[Picture]) -> dict[str, Any]:
    """Curves of claims; large figures, one below the other; and hand paths, small and many, side by side."""
    curves = [_embedded(picture) for picture in pictures if picture.png.name.startswith("curve_")]
    large = [_embedded(picture) for picture in pictures if not picture.png.name.startswith(("curve_", "paths_"))]
    groups: dict[str, list[dict[str, str]]] = {}
    for picture in pictures:
        if picture.png.name.startswith("paths_"):
            groups.setdefault(picture.caption.partition(":")[0], []).append(_embedded(picture))
    small = [{"title": f"{task}: hand paths", "figures": group} for task, group in groups.items()]
    return {"curves": curves, "figures": large, "small_figures": small}


def _embedded(picture: Picture) -> dict[str, str]:
    data = base64.b64encode(picture.png.read_bytes()).decode("ascii")
    return {"uri": f"data:image/png;base64,{data}", "caption": picture.caption}


def _job(outcome: JobOutcome) -> dict[str, str]:
    log = outcome.log if outcome.state != JobState.DONE else None
    task, _, model = outcome.job.name.partition("/")
    name, _, rest = model.partition("-")
    rest = rest if "=" in rest else rest.replace("-", " ")  # settings, or a seed
    return {
        "name": f"{task_label(task)}, {model_label(name)}" + (f", {rest}" if rest else ""),
        "state": str(outcome.state),
        "minutes": f"{outcome.seconds / 60:.1f}" if outcome.seconds else "before",
        "error": outcome.error or "",
        "log": _end_of(log) if log is not None and log.is_file() else "",
    }


def _end_of(log: Path) -> str:
    """The last lines of a log."""
    with log.open("rb") as file:
        file.seek(max(log.stat().st_size - LOG_BYTES, 0))
        text = file.read(LOG_BYTES).decode("utf-8", errors="replace")
    return "\n".join(text.splitlines()[-LOG_LINES:])


def _jobs_summary(outcomes: Sequence[JobOutcome], networks: int) -> str:
    """Say how many trainings are done, and of how many networks each is."""
    done = sum(outcome.state == JobState.DONE for outcome in outcomes)
    each = f", each of {networks} networks" if networks > 1 else ""
    text = f"{done} of {len(outcomes)} trainings are done{each}."
    if done < len(outcomes):
        text += " The others are missing from every number above; call the command again to try them once more."
    return text


def _setup(findings: Findings) -> str:
    sentences = ["Every setting of every training is in config.yaml of its run, below the folder runs."]
    if findings.study.is_calibrated:
        supervised = is_supervised(findings.study.algo)
        what = "the kind and strength of the weight penalty and the radii of the goals"
        by_each = "the strength of the weight penalty by this algorithm, its kind and the radii of the goals by bptt"
        sentences.append(
            f"What the paper leaves open, {what if supervised else by_each}, was chosen for C1 to C3 on the unilateral "
            "models and then kept; C4 to C14 are tests of that choice."
        )
    return " ".join([*sentences, penalty_in_words(findings.configs)])


def _blocks(findings: Findings) -> list[dict[str, str]]:
    seen: dict[str, TrainConfig] = {config.task: config for config in findings.configs}
    blocks = [{"title": "The study", "text": _yaml(findings.study.to_values())}]
    blocks += [
        {"title": f"Settings of {task_label(task)}, {model_label(config.model)}", "text": _yaml(config.to_values())}
        for task, config in seen.items()
    ]
    blocks.append({"title": "Versions", "text": json.dumps(versions(), indent=2)})
    return blocks


def _yaml(values: Any) -> str:
    return yaml.safe_dump(values, sort_keys=False)
