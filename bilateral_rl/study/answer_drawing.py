"""Specification curves of an answer: every claim under every reading."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence

from bilateral_rl.claims import Judgement
from bilateral_rl.figures.specification_curve import Specification, specification_curve
from bilateral_rl.study.answer import Answer
from bilateral_rl.study.drawing import Drawing

_TITLE_CHARACTERS = 72


def draw_answer(answer: Answer) -> Iterator[Drawing]:
    """Draw the curve of each claim to which several readings give different numbers, if they give any."""
    for number in answer.numbers:
        judgements = answer.distinct(number)
        specifications = _specifications(answer, number, judgements)
        if len(judgements) < 2 or all(math.isnan(one.effect.value) for one in specifications):
            continue
        statement = answer.claim(judgements[0], number).statement
        title = textwrap.fill(f"{number}: {statement.rstrip('.')}", _TITLE_CHARACTERS)
        figure = specification_curve(specifications, title)
        caption = f"{number} under {len(judgements)} readings that give it different numbers. {statement}"
        yield Drawing(f"curve_{number}", caption, figure)


def _specifications(answer: Answer, number: str, judgements: Sequence[Judgement]) -> list[Specification]:
    claims = [answer.claim(judgement, number) for judgement in judgements]
    return [
        Specification(claim.deciding.effect, claim.verdict, judgement.choices)
        for claim, judgement in zip(claims, judgements, strict=True)
    ]
