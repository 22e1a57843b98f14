"""Readings as small YAML files: those that are shipped with a study, and files of one's own."""

from __future__ import annotations

import importlib.resources
import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from bilateral_rl.config.parse import Values, build, merge
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.yaml_files import read_settings

ALL = "all"
"""What asks for every reading that is shipped."""


class _Reading(Protocol):
    @property
    def name(self) -> str: ...


R = TypeVar("R", bound=_Reading)


class ReadingFiles(Generic[R]):
    """The readings of one study, in a folder of the package.

    Args:
        folder: path below the package.
        kind: what a file holds.
        anchors: names of those that come first, from which others deviate.
        what: what they are readings of, for messages.
    """

    def __init__(self, folder: str, kind: type[R], anchors: Sequence[str], what: str) -> None:
        self._files = importlib.resources.files("bilateral_rl").joinpath(*folder.split("/"))
        self._kind, self._anchors, self._what = kind, tuple(anchors), what

    def names(self) -> list[str]:
        """Return the names of the readings that are shipped, the anchors first."""
        names = sorted(path.name.removesuffix(".yaml") for path in self._files.iterdir() if path.name.endswith(".yaml"))
        return [*self._anchors, *(name for name in names if name not in self._anchors)]

    def load(self, requested: Sequence[str]) -> list[R]:
        """Load readings, each once and in the order in which they are asked for.

        Args:
            requested: "all" for those that are shipped, the name of one, or a file, which ends in .yaml or .yml.

        Raises:
            UserError: a name that is unknown, a file that holds no reading, or two readings of one name.
        """
        readings: dict[str, R] = {}
        for text in requested:
            for reading in self._load(text):
                if readings.setdefault(reading.name, reading) != reading:
                    raise UserError(
                        f"Two readings are called {reading.name!r}; give the one in {text} a name of its own."
                    )
        return list(readings.values())

    def _load(self, text: str) -> Iterator[R]:
        if text == ALL:
            yield from (self._build(self._values(name), name) for name in self.names())
        elif text.endswith((".yaml", ".yml")):
            values = {"name": Path(text).stem} | read_settings(Path(text))
            if values["name"] in self.names():
                raise UserError(f"A reading called {values['name']!r} is shipped; give the one in {text} another name.")
            yield self._build(values, text)
        else:
            yield self._build(self._values(text), text)

    def _build(self, values: Mapping[str, Any], where: str) -> R:
        """Build a reading from what its file says, on top of the one that it deviates from."""
        anchor = values.get("anchor")
        inherited = self._values(str(anchor)) if anchor is not None else {}
        if "anchor" in inherited:  # which deviates itself
            inherited = merge(self._values(inherited["anchor"]), inherited)
        own = {name: value for name, value in inherited.items() if name not in ("name", "why", "source", "anchor")}
        try:
            return build(self._kind, merge(own, values))
        except UserError as error:
            raise UserError(f"{where} is no reading of {self._what}. {error}") from None

    def _values(self, name: str) -> Values:
        """What the file of a shipped reading says. Raises UserError if there is none of that name."""
        names = self.names()
        if name not in names:
            close = get_close_matches(name, names, n=3, cutoff=0.3)
            known = f"names such as {', '.join(dict.fromkeys([*close, *self._anchors]))}"
            raise UserError(f"Unknown reading {name!r}; choose from all, {known}, or a file that ends in .yaml.")
        with importlib.resources.as_file(self._files / f"{name}.yaml") as path:
            return read_settings(path)


def check_reading(name: str, why: str, source: str) -> None:
    """Raise a ValueError for a name that is none, or a reading that gives no reason or no source."""
    if not re.fullmatch(r"[\w.-]{1,60}", name):
        raise ValueError(f"name must be 1 to 60 letters, digits, dots and dashes, got {name!r}")
    for word, text in (("why", why), ("source", source)):
        if not text.strip():
            raise ValueError(f"{word} is missing: say in a sentence why the paper may be read so, and from what")
