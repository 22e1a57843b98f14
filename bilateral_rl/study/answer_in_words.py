"""The answer in sentences, for readers who never saw the code."""

from __future__ import annotations

from collections.abc import Sequence

from bilateral_rl.study.answer import Answer, tally
from bilateral_rl.study.words import WORDS, Words

CELL = (
    "Each cell: the verdict (✓ supported, ✗ not supported, ? undecided) and the effect of the component that decides "
    "it, in percent of the mean, counted from the line that the claim draws: above 0 on the claim's side. A claim is "
    "several statements that must all hold; the one that decides is the weakest: of the statements that share the "
    "claim's verdict, the one with the least effect."
)
EXPLORING = (
    "These seeds are an exploration: they serve to choose a reading, and among many readings some verdicts come out by "
    "luck. What is to be called a result must be found again, under a reading chosen now, on seeds from 100 on."
)
CONFIRMING = (
    "These seeds are a confirmation: none of them was looked at when the reading was chosen, and the verdicts under "
    "that reading are results."
)


def opening(answer: Answer, words: Words = WORDS["paper"]) -> str:
    """Say in a few sentences what holds in every reading, in none, and in which reading most."""
    n = len(answer.judgements)
    if nothing_judged(answer):
        under = f"{n} readings" if n > 1 else f"the reading “{answer.judgements[0].reading}”"
        sentences = [*_notes(answer), unjudged_in_words(answer)]
        return " ".join([*sentences, f"{words.gaps} {len(answer.numbers)} claims were to be judged under {under}."])
    if n == 1:
        return _of_one(answer, words)
    sentences = [f"{words.gaps} {len(answer.numbers)} claims were judged under {n} readings."]
    if answer.in_none == answer.numbers:
        return " ".join([*sentences, f"No claim holds under any of them{_of_none(answer)}."])
    sentences.append(f"{_claims(answer.in_all)} {_holds(answer.in_all)} under every one.")
    sentences.append(f"{_claims(answer.in_none)} {_holds(answer.in_none)} under none{_of_none(answer)}.")
    if answer.turning:
        sentences.append(f"{_list(answer.turning)} {_holds(answer.turning)} under some and not under others.")
    return " ".join([*sentences, _most(answer)])


def unjudged_in_words(answer: Answer) -> str:
    """Say which claims no reading can judge, because results of models that they are about are missing; "" if none."""
    claims = _unjudged(answer)
    if not claims:
        return ""
    missing = "models that they are about were left out, or have no results"
    if _notes(answer):
        missing = "models that they are about never learned, were left out, or have no results"
    if claims == answer.numbers:
        return f"No claim can be judged: {missing}. They all count as undecided."
    return f"{_list(claims)} cannot be judged: {missing}. They count as undecided."


def nothing_judged(answer: Answer) -> bool:
    """Whether no reading can judge any claim."""
    return _unjudged(answer) == answer.numbers


def turns_in_words(answer: Answer, number: str) -> str:
    """Say which choices make a claim hold, or no longer hold; "" where there is one reading only."""
    if len(answer.judgements) == 1:
        return ""
    if number in _unjudged(answer):
        return "nothing to judge it by"
    turns = [turn for turn in answer.turns(number) if "supported" in (turn.before, turn.after)]
    if not turns:
        return "no single choice makes it hold" if number in answer.in_none else "no single choice"
    by_source: dict[tuple[str, str], dict[str, list[str]]] = {}
    for turn in turns:
        choices = by_source.setdefault((turn.source.reading, turn.before), {})
        choices.setdefault(turn.after, []).append(turn.choice)
    alike: dict[str, list[str]] = {}
    for (source, before), choices in by_source.items():
        words = "; ".join(f"{after} with {_gathered(chosen)}" for after, chosen in choices.items())
        alike.setdefault(f"({before}): {words}", []).append(f"“{source}”")
    return ". ".join(f"From {_list(sources)} {words}" for words, sources in alike.items()) + "."


def held_in_words(answer: Answer, number: str) -> str:
    """Say under how many readings a claim has which verdict; "" where there is one reading only."""
    count, n = answer.count(number), len(answer.judgements)
    if n == 1:
        return ""
    if len(count) == 1:
        return f"under all {n}"
    rest = ", ".join(f"{count[verdict]} {verdict}" for verdict in ("undecided", "not supported") if count[verdict])
    return f"supported under {count['supported']} of {n} ({rest})"


def notes_in_words(answer: Answer) -> str:
    """Say what must be known of all numbers before any of them is read; "" if nothing."""
    return " ".join(_notes(answer))


def _notes(answer: Answer) -> list[str]:
    """The notes of the readings, each once; of many that differ, that of the first."""
    notes = list(dict.fromkeys(filter(None, (judgement.note for judgement in answer.judgements))))
    return [f"{notes[0]}."] if notes else []


def _unjudged(answer: Answer) -> list[str]:
    """The claims that no reading can judge."""
    return [number for number in answer.numbers if all(answer.claim(j, number).unjudged for j in answer.judgements)]


def _of_one(answer: Answer, words: Words) -> str:
    (judgement,) = answer.judgements
    count = tally(judgement)
    return (
        f"Under the reading “{judgement.reading}”, {count['supported']} {words.of_claims} "
        f"{len(answer.numbers)} claims hold, {count['not supported']} do not, and {count['undecided']} stay "
        f"undecided. {judgement.why}"
    )


def _of_none(answer: Answer) -> str:
    """Which of the claims that hold nowhere are contradicted everywhere."""
    everywhere = [n for n in answer.in_none if answer.count(n)["not supported"] == len(answer.judgements)]
    if not everywhere:
        return ""
    return f"; contradicted under every one {'is' if len(everywhere) == 1 else 'are'} {_list(everywhere)}"


def _most(answer: Answer) -> str:
    counts = {judgement.reading: tally(judgement)["supported"] for judgement in answer.judgements}
    most = max(counts.values())
    best = [f"“{name}”" for name, count in counts.items() if count == most]
    shown = ", ".join(best[:3]) + (f" and {len(best) - 3} more" if len(best) > 3 else "")
    anchors = _list([f"{counts[anchor.reading]} under “{anchor.reading}”" for anchor in answer.anchors])
    return f"Most hold under {shown}: {most}. Of the readings from which the others deviate: {anchors}."


def _claims(numbers: Sequence[str]) -> str:
    return _list(numbers) if numbers else "No claim"


def _holds(numbers: Sequence[str]) -> str:
    return "hold" if len(numbers) > 1 else "holds"


def _list(numbers: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(numbers[:-1]), *numbers[-1:]]))


def _gathered(choices: Sequence[str]) -> str:
    """Choices in words; those that fill the same gap name it once."""
    values: dict[str, list[str]] = {}
    for choice in choices:
        gap, _, value = choice.partition(": ")
        values.setdefault(gap, []).append(value)
    return ", ".join(f"{gap} {' or '.join(of_gap)}".strip() for gap, of_gap in values.items())
