"""Write docs/reference/options.md, every command and option, from the command line itself.

Run it after a change of a command: ``python docs/scripts/options_page.py``. A test compares the page with the code.
"""

from __future__ import annotations

import re
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperArgument, TyperOption

from bilateral_rl.commands.app import app

PAGE = Path(__file__).parents[1] / "reference" / "options.md"
KINDS: dict[type, str] = {int: "a whole number", float: "a number", str: "a word", Path: "a file or folder", bool: ""}

HEAD = """# Every command and option

<!-- made by docs/scripts/options_page.py from the command line: change that, and run it again -->

This page lists what `bilateral-rl COMMAND --help` says. [The commands, one by one](../commands.md) says what each is
for, with examples. `RUN` is the folder of a run, such as `runs/random_reach/cc_s-ppo-1`, and `RUN:3` its network of
seed 3. An option that may be repeated is written once for each value.
"""


def page() -> str:
    """Return the whole page."""
    commands = typer.main.get_group(app).commands
    functions = [one.callback for one in app.registered_commands]
    sections = [section(*command, function) for command, function in zip(commands.items(), functions, strict=True)]
    return "\n".join([HEAD, *sections])


def section(name: str, command: Any, function: Any) -> str:
    """Return what there is to say about one command, which calls the function."""
    hints = typing.get_type_hints(function, include_extras=True)
    kinds = {parameter.name: _kind(hints[parameter.name]) for parameter in command.params if parameter.name in hints}
    arguments = [one for one in command.params if isinstance(one, TyperArgument)]
    usage = " ".join([f"bilateral-rl {name}", *(_placeholder(one) for one in arguments), "[OPTIONS]"])
    rows = [_argument(one) for one in arguments]
    rows += [_option(one, kinds) for one in command.params if isinstance(one, TyperOption)]
    lines = [f"## `{name}`", "", _sentence(command.help or ""), "", "```text", usage, "```", ""]
    lines += ["| option | takes | default | what it does |", "|---|---|---|---|"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)]) + "\n"


def _kind(hint: Any) -> str:
    """Say what kind of value an annotation such as ``Annotated[list[Path] | None, …]`` stands for."""
    while not isinstance(hint, type) or isinstance(hint, types.GenericAlias):
        hint = next(inner for inner in typing.get_args(hint) if inner is not types.NoneType)
    return {int: "a whole number", float: "a number", str: "a word", Path: "a file or folder", bool: ""}.get(
        hint, hint.__name__
    )


def _argument(one: TyperArgument) -> tuple[str, ...]:
    return f"`{_placeholder(one)}`", "", "", _sentence(one.help or "")


def _option(one: TyperOption, kinds: Mapping[str, str]) -> tuple[str, ...]:
    names = ", ".join(f"`{name}`" for name in (*one.opts, *one.secondary_opts))
    takes = " or ".join(f"`{word}`" for word in one.metavar.split("|")) if one.metavar else kinds[str(one.name)]
    return names, takes, _default(one), _sentence(one.help or "")


def _placeholder(one: TyperArgument) -> str:
    return one.metavar or (one.name or "").upper()


def _default(one: TyperOption) -> str:
    if isinstance(one.show_default, str):
        return one.show_default
    if one.required:
        return "required"
    if isinstance(one.default, bool):
        return "yes" if one.default else "no"
    return "" if one.default is None else f"{one.default:,}" if isinstance(one.default, int) else f"`{one.default}`"


def _sentence(text: str) -> str:
    words = " ".join(text.split()).replace("|", "\\|")
    return re.sub(r"(?<!\S)(--[a-z-]+)", r"`\1`", words)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
