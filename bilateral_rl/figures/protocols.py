"""One look for each lesion protocol: the more of the network adapts, the darker."""

from __future__ import annotations

from collections.abc import Sequence

from bilateral_rl.figures.style import ModelStyle

CONTROL_COLOR = "#e34a33"
"""Color of fresh networks that were treated like the trained ones."""
_PLAIN = {
    "none": ModelStyle("#8c8c8c", "o", "-"),
    "output": ModelStyle("#a78fd0", "s", "-"),
    "combination": ModelStyle("#7b52ab", "^", "-"),
    "everything": ModelStyle("#3f1069", "D", "-"),
}
"""Look of the protocols that deviate in nothing, grey and violet: colors that no model and no hemisphere has."""
_OTHERS = tuple(
    ModelStyle(color, marker, "-")
    for color, marker in (
        ("#1b7837", "v"), ("#b8860b", "P"), ("#4393c3", "X"), ("#c51b7d", "h"),
        ("#7fbf7b", "<"), ("#de77ae", ">"), ("#2166ac", "p"), ("#e08214", "d"),
    )
)  # fmt: skip
"""Looks of the others, one after the other, again from the first where there are more."""


def protocol_styles(protocols: Sequence[str]) -> dict[str, ModelStyle]:
    """Return the look of each protocol by its name, in the order given."""
    others = [name for name in protocols if name not in _PLAIN]
    looks = _PLAIN | {name: _OTHERS[i % len(_OTHERS)] for i, name in enumerate(others)}
    return {name: looks[name] for name in protocols}
