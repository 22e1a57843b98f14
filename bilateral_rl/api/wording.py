"""Errors as Python says them: the sentences of the rooms below name options and commands of the command line."""

from __future__ import annotations

import functools
import inspect
import re
import shlex
from collections.abc import Callable, Sequence
from typing import Any, ParamSpec, TypeVar

from bilateral_rl.io.errors import UserError
from bilateral_rl.io.yaml_files import parse_yaml

P = ParamSpec("P")
R = TypeVar("R")

_ARGUMENTS = {
    "--set": "settings",
    "--metric": "metrics",
    "--resume": "resume()",
    "--no-retrain": 'retrain="none"',
    "--no-control": "control=False",
    "--trust-pickle": "trust_pickle=True",
}
"""Options whose argument is called otherwise, or that stand for a value of it; others have underscores for dashes."""
_CALLS = {
    "train": "train",
    "resume": "load({}).resume",
    "list": "list_runs",
    "import": "import_model",
}
"""What a command that a sentence advises is in Python, with the place of RUN."""
_CODE, _PROGRAM = re.compile(r"(`[^`]*`)"), "`bilateral-rl "
_OPTION = re.compile(r"(?<![\w-])--[a-z]+(?:-[a-z]+)*")


def in_python(function: Callable[P, R]) -> Callable[P, R]:
    """Let the errors of a function of the Python face name its arguments, not options of the command line."""
    arguments = inspect.signature(function).parameters

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        if unknown := [name for name in kwargs if name not in arguments]:
            _refuse_bare_setting(function.__name__, unknown[0], "settings" in arguments)
        try:
            return function(*args, **kwargs)
        except UserError as error:
            error.args = (python_words(error.on_command_line),)
            raise

    return call


def _refuse_bare_setting(function: str, name: str, takes_settings: bool) -> None:
    """Raise a TypeError for a setting of trials that was given as an argument; Python refuses what is left."""
    from bilateral_rl.envs.settings import TrialSettings  # here alone: it is seldom needed

    if takes_settings and name in TrialSettings.__dataclass_fields__:
        raise TypeError(f"{function}() has no argument {name!r}: give settings={{'trial.{name}': …}}.")


def python_words(sentence: str) -> str:
    """Return a sentence with arguments in place of options, and with calls in place of commands."""
    return "".join(map(_in_python, _CODE.split(sentence)))


def _in_python(part: str) -> str:
    if part.startswith(_PROGRAM):
        return f"`{_call(part[len(_PROGRAM) : -1])}`"
    return part if _CODE.fullmatch(part) else _OPTION.sub(lambda found: f"`{argument(found[0])}`", part)


def argument(option: str) -> str:
    """Return the name of the argument that is ``option`` on the command line."""
    return _ARGUMENTS.get(option, option.removeprefix("--").replace("-", "_"))


def _call(command: str) -> str:
    """Return the call that ``command``, without the program's name, comes to."""
    name, *words = shlex.split(command)
    runs, said = _given(words)
    if "resume" in said:
        name, runs = "resume", [said.pop("resume")]
    texts = [repr(run) for run in runs]
    given = [f"{key}={value!r}" if value is not None else key for key, value in said.items()]
    if name == "lesion":  # the command keeps its results; a notebook has to ask for that
        given = [text.replace("lesion=", "lesions=") for text in given]
        return f"run = bilateral_rl.load({texts[0]}); run.lesion({', '.join([*given, 'out=run.lesions_folder'])})"
    if name not in _CALLS:
        return f"bilateral-rl {command}"
    call = _CALLS[name]
    if "{}" in call:
        call, texts = call.format(*texts), []
    return f"bilateral_rl.{call}({', '.join([*texts, *given])})"


def _given(words: Sequence[str]) -> tuple[list[str], dict[str, Any]]:
    """Return what stands alone, and values by argument: None for an option without one, a list for one that repeats."""
    alone: list[str] = []
    said: dict[str, Any] = {}
    rest = list(words)
    while rest:
        word = rest.pop(0)
        if not word.startswith("--"):
            alone.append(word)
        elif "=" in (name := argument(word).removesuffix("()")):
            said[name] = None
        else:
            value = parse_yaml(rest.pop(0))
            said[name] = [*_listed(said[name]), value] if name in said else value
    return alone, said


def _listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]
