"""Roles such as :class:`~bilateral_rl.envs.ArmEnv` in docstrings become links between the pages of the API."""

from __future__ import annotations

import re
from typing import Any

import griffe

ROLE = re.compile(r":(?:class|func|meth|mod|attr|data):`(~?)([\w.]+)`")


class Roles(griffe.Extension):
    """Rewrites every docstring that is read."""

    def on_instance(self, *, obj: griffe.Object, **_: Any) -> None:
        """Rewrite the docstring of a module, class, function or attribute."""
        if obj.docstring is not None:
            obj.docstring.value = ROLE.sub(_words, obj.docstring.value)


def _words(role: re.Match[str]) -> str:
    short, name = role.groups()
    words = name.rpartition(".")[2] if short else name
    # Optional: not everything that docstrings name has a place in the API.
    return f'<autoref optional identifier="{name}"><code>{words}</code></autoref>'
