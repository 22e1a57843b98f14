"""The seven lesions, as reversible states of a network (paper section 6)."""

from __future__ import annotations

from dataclasses import dataclass

from bilateral_rl.vocabulary import SIDES, Side


@dataclass(frozen=True)
class Lesion:
    """What a lesion takes away.

    Args:
        input_of: the side whose input is zero; its biases still flow, also over the callosum.
        output_of: the side that contributes nothing to the combination; it still sends over the callosum.
        callosum: whether the exchange between the sides is cut.

    Raises:
        ValueError: a side other than "dominant" and "non_dominant".
    """

    input_of: Side | None = None
    output_of: Side | None = None
    callosum: bool = False

    def __post_init__(self) -> None:
        for side in (self.input_of, self.output_of):
            if side is not None and side not in SIDES:
                raise ValueError(f"unknown side {side!r}; choose from {', '.join(SIDES)}.")


INTACT = Lesion()

LESIONS: dict[str, Lesion] = {
    "shallow_dominant": Lesion(input_of="dominant"),
    "shallow_non_dominant": Lesion(input_of="non_dominant"),
    "deep_dominant": Lesion(output_of="dominant"),
    "deep_non_dominant": Lesion(output_of="non_dominant"),
    "callosum": Lesion(callosum=True),
    "callosum_deep_dominant": Lesion(output_of="dominant", callosum=True),
    "callosum_deep_non_dominant": Lesion(output_of="non_dominant", callosum=True),
}
"""The paper's lesions by name."""

RELEASED_LESIONS: dict[str, Lesion] = LESIONS | {
    "callosum_deep_dominant": Lesion(input_of="dominant", callosum=True),
    "callosum_deep_non_dominant": Lesion(input_of="non_dominant", callosum=True),
}
"""The released code's: its combined lesions zero the side's input, not its output."""


def find_lesion(name: str, lesions: dict[str, Lesion] = LESIONS) -> Lesion:
    """The lesion called ``name`` ("intact" is none). Raises ValueError naming the valid choices."""
    if name == "intact":
        return INTACT
    if name not in lesions:
        raise ValueError(f"unknown lesion {name!r}; choose from {', '.join(['intact', *lesions])}.")
    return lesions[name]


def lesion_words(name: str) -> str:
    """The name of a lesion, or "intact", as people read it: ``callosum, deep non-dominant``."""
    return name.replace("non_dominant", "non-dominant").replace("callosum_", "callosum, ").replace("_", " ")
