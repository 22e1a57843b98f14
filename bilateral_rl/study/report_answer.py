"""The answer as a report shows it: claims with what they turn on, and claims by readings."""

from __future__ import annotations

import math
from typing import Any

from bilateral_rl.claims import Claim, Judgement
from bilateral_rl.study.answer import Answer, chosen_otherwise, n_supported, tally
from bilateral_rl.study.answer_in_words import CELL, held_in_words, opening, turns_in_words
from bilateral_rl.study.words import Words

SIGNS = {"supported": "✓", "not supported": "✗", "undecided": "?"}


def answer_values(answer: Answer, words: Words) -> dict[str, Any]:
    """Return what the report's template shows of the answer."""
    return {
        "many": len(answer.judgements) > 1,
        "opening": opening(answer, words),
        "claim_column": words.claim,
        "reading_is": words.reading,
        "summary": [_summary(answer, number) for number in answer.numbers],
        "cell_meaning": CELL,
        "numbers": answer.numbers,
        "rows": [_row(answer, judgement) for group in answer.groups() for judgement in group],
        "readings": [_explained(answer, judgement) for judgement in answer.judgements],
    }


def _summary(answer: Answer, number: str) -> dict[str, str]:
    verdicts = list(answer.count(number))
    return {
        "number": number,
        "anchor": answer.anchors[0].reading,
        "statement": answer.claim(answer.anchors[0], number).statement,
        "verdict": verdicts[0] if len(verdicts) == 1 else "",
        "held": held_in_words(answer, number),
        "turns": turns_in_words(answer, number),
    }


def _row(answer: Answer, judgement: Judgement) -> dict[str, Any]:
    source, count = answer.source(judgement), tally(judgement)
    return {
        "name": judgement.reading,
        "label": chosen_otherwise(source, judgement) if source else f"“{judgement.reading}”",
        "anchor": source is None,
        "why": judgement.why,
        "cells": [_cell(claim) for claim in judgement.claims],
        "tally": " / ".join(str(count[verdict]) for verdict in ("supported", "not supported", "undecided")),
    }


def _cell(claim: Claim) -> dict[str, str]:
    deciding, effect = claim.deciding, claim.deciding.effect.value
    return {
        "verdict": claim.verdict,
        "text": SIGNS[claim.verdict] + ("" if math.isnan(effect) else f" {100 * effect:+z.0f}").replace("-", "−"),
        "title": f"{claim.number}, {claim.verdict}; {n_supported(claim)} of {len(claim.components)} statements "
        f"supported. Decided by {deciding.text}: {deciding.numbers}",
    }


def _explained(answer: Answer, judgement: Judgement) -> dict[str, str]:
    source = answer.source(judgement)
    all_choices = "; ".join(f"{name}: {value}" for name, value in judgement.choices.items())
    otherwise = f"as “{source.reading}”, but {chosen_otherwise(source, judgement)}" if source else all_choices
    return {"name": judgement.reading, "choice": otherwise, "why": judgement.why, "source": judgement.source}
