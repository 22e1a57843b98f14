"""What a report says of the paper and of the study of two arms in their own words."""

from __future__ import annotations

from dataclasses import dataclass

from bilateral_rl.claims import margins
from bilateral_rl.claims.two_arms.evidence import NOT_LEARNED
from bilateral_rl.study.plan import Subject

_VERDICTS = (
    "A claim is supported if all its parts are, not supported if any is not, otherwise undecided. A part with a "
    "direction is supported if the difference is significant (adjusted p < 0.05), and not supported if it is "
    "significantly the other way or its interval leaves no room for a difference that matters. A part with a size is "
    "supported if the 95 % interval lies within the range, not supported if it lies outside; a difference is shown to "
    "be small by two one-sided tests at 2.5 % each, which comes to the same. Seeds are the unit. "
)
_MATTERS = f"a difference matters from {100 * margins.SMALLEST_EFFECT:g} % of the means on"


@dataclass(frozen=True)
class Words:
    """Sentences of a report, and parts of some."""

    title: str
    """Beginning of the title, to which the algorithm is added."""
    claim: str
    """What the column of the statements is called."""
    of_claims: str
    """Whose claims they are, before their number."""
    gaps: str
    """Why there are readings: sentences that end before the number of claims."""
    reading: str
    """What a reading is."""
    rule: str
    """How verdicts come about."""
    lesions: str
    """What lesions are, and what follows them."""


WORDS: dict[Subject, Words] = {
    "paper": Words(
        title="Left/right brain and motor control: the paper's claims",
        claim="the paper's claim",
        of_claims="of the paper's",
        gaps="The paper leaves open how parts of it were done; each way to fill these gaps is a reading. Its",
        reading="A reading is one way to fill what the paper leaves open.",
        rule=_VERDICTS
        + "What the paper's words leave open, we set before the claims were computed: "
        + f"{_MATTERS}; completion agrees within "
        f"{margins.COMPLETION_TOLERANCE:g} points; about 95 % is {margins.COMPLETES:g} % or more; little, or about as, "
        f"is within {100 * margins.LITTLE:g} %; almost fully is {100 * margins.RECOVERED:g} % or more, a lot "
        f"{100 * margins.DROPPED:g} % or less of the intact network; at least as good is "
        f"{100 * margins.NOT_WORSE:g} % or more; other effects agree within half their size.",
        lesions="Lesions: shallow – a side's input is zero, its biases still flow; deep – a side contributes nothing "
        "to the output, but still sends over the callosum; callosum – no exchange between the sides. What a hemisphere "
        "does alone is what the network does after a lesion of the other one, a deep one unless the reading says "
        "otherwise. What follows a lesion is the reading's protocol. The same is done to a freshly initialized "
        "network, the control: a state that is not better than it shows what was relearned, not what was kept.",
    ),
    "two_arms": Words(
        title="Two arms, one brain: claims on bimanual control",
        claim="claim",
        of_claims="of the",
        gaps="The design leaves choices open; each way to make them is a reading. The",
        reading="A reading is one way to make a choice that the design leaves open; what decides under “default” was "
        "written down before any result, and everything else stands beside it; but for two rules that a review with "
        "made-up results made stricter: B3 asks that neither hand is worse in its own role, and B6 that each deficit "
        "is greater after its own lesion than after the other.",
        rule=_VERDICTS + "What the claims' words leave open, we set before they were computed: "
        f"{_MATTERS}; absence of an interaction is less than ±{100 * margins.LITTLE:g} % of the mean. A reach is "
        "called straight by its maximal perpendicular deviation until the hand first comes within 2 cm of the target, "
        "a hold stable by its RMS error, unless the reading says otherwise. An undershoot looks straight, so the "
        "extent of reaches stands beside. The interaction is of errors in percent of both hands' mean in the same "
        "network, half the sum of the dominant hand's advantage in reaching and the other's in holding. A network "
        f"that completes less than {NOT_LEARNED:g} % of its reaches within 5 cm, with either hand, has not learned: it "
        "is named and left out, as a hand that stays where it is moves straight and holds well. Every test is "
        "counterbalanced: half of its trials are the others with arms and roles exchanged.",
        lesions="Lesions: deep – a side contributes nothing to either arm's commands, but still sends over the "
        "callosum; callosum – no exchange between the sides. The arm opposite to the side of a lesion, which that side "
        "moved, is the contralesional one; the arm of the same side is the ipsilesional one. Networks are tested in "
        "the same trials with the spring and without.",
    ),
}
"""By what a study is about."""
