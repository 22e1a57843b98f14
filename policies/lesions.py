"""The seven lesions, as reversible states of a network (paper section 6)."""

from __future__ import annotations

from dataclasses import dataclass

from bilateral_rl.policies.quantities import switch
from bilateral_rl.vocabulary import SIDES, Side

INTACT = "intact"
"""The name of a network without a lesion, in files, tables and on the command line."""


@dataclass(frozen=True)
class Lesion:
    """The parts of a network that are switched off; by default none is.

    Args:
        input_of: the side whose input is zero; its biases still flow, also over the callosum.
        output_of: the side that contributes nothing to the combination; it still sends over the callosum.
        callosum: whether the exchange between the sides is cut.

    Raises:
        ValueError: a side other than "dominant" and "non_dominant", or a callosum that is neither True nor False.
    """

    input_of: Side | None = None
    output_of: Side | None = None
    callosum: bool = False

    def __post_init__(self) -> None:
        for side in (self.input_of, self.output_of):
            if side is not None and side not in SIDES:
                raise ValueError(f"unknown side {side!r}; choose from {', '.join(SIDES)}.")
        object.__setattr__(self, "callosum", switch("callosum", self.callosum))


NO_LESION = Lesion()
"""The state of an intact network."""

LESIONS: dict[str, Lesion] = {
    "shallow_dominant": Lesion(input_of="dominant"),
    "shallow_non_dominant": Lesion(input_of="non_dominant"),
    "deep_dominant": Lesion(output_of="dominant"),
    "deep_non_dominant": Lesion(output_of="non_dominant"),
    "callosum": Lesion(callosum=True),
    "callosum_deep_dominant": Lesion(output_of="dominant", callosum=True),
    "callosum_deep_non_dominant": Lesion(output_of="non_dominant", callosum=True),
}
"""The paper's seven lesions by name."""

RELEASED_LESIONS: dict[str, Lesion] = LESIONS | {
    "callosum_deep_dominant": Lesion(input_of="dominant", callosum=True),
    "callosum_deep_non_dominant": Lesion(input_of="non_dominant", callosum=True),
}
"""The seven lesions as the paper's released code has them: the combined ones zero a side's input, not its output."""

LESIONS_OF: dict[str, dict[str, Lesion]] = {"paper": LESIONS, "released": RELEASED_LESIONS}
"""The lesions of each profile."""


def find_lesion(name: str, lesions: dict[str, Lesion] = LESIONS) -> Lesion:
    """Return the lesion called ``name``, or :data:`NO_LESION` for "intact".

    Raises:
        ValueError: an unknown name; the message lists the valid ones.
    """
    if name == INTACT:
        return NO_LESION
    if name not in lesions:
        raise ValueError(f"unknown lesion {name!r}; choose from {', '.join([INTACT, *lesions])}.")
    return lesions[name]


def lesion_words(name: str) -> str:
    """Return the name of a lesion, or "intact", as people read it: ``callosum, deep non-dominant``."""
    return name.replace("non_dominant", "non-dominant").replace("callosum_", "callosum, ").replace("_", " ")
