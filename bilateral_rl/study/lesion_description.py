"""What the results of lesions are of, the entries of ``settings.json``: compared, in words, and as a command."""

from __future__ import annotations

import contextlib
import dataclasses
import shlex
from collections.abc import Iterator, Mapping
from typing import Any

from bilateral_rl.analysis.protocols import DEFAULT_PROTOCOLS, Protocol
from bilateral_rl.config.parse import build
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import FINAL
from bilateral_rl.study.lesioning import LesionSettings
from bilateral_rl.study.provenance import SOURCE

_NO_TREATMENT = {*SOURCE, "threads", "device"} - {"weights"}
"""Entries of ``settings.json`` in which two studies may differ and still be the same one."""


def up_to_date(description: Mapping[str, Any]) -> dict[str, Any]:
    """The same entries as those of this version: 0.1.0 only knew whether the output layer was retrained, too."""
    retrain = description.get("retrain")
    if not isinstance(retrain, bool) or "protocols" in description:
        return dict(description)
    protocols = [Protocol("none"), *([Protocol("output")] if retrain else [])]
    entries = {name: value for name, value in description.items() if name != "retrain"}
    return entries | {"protocols": [dataclasses.asdict(protocol) for protocol in protocols]}


def differences(stored: Mapping[str, Any], wanted: Mapping[str, Any]) -> Iterator[str]:
    """Say in what treatment a study that is there differs from the one that is wanted."""
    for name, value in wanted.items():
        if name not in _NO_TREATMENT and stored.get(name, value) != value:
            yield f"{name}: {_in_words(name, stored[name])} there and {_in_words(name, value)} asked for"


def _in_words(name: str, value: Any) -> str:
    """Return the value of an entry of ``settings.json`` as short as a sentence can have it."""
    if value is None:
        return "all" if name == "lesions" else "the run's own"
    if name == "protocols":
        with contextlib.suppress(KeyError, TypeError, UserError):  # of what is stored nobody knows
            return ", ".join(build(Protocol, values).name for values in value)
    if isinstance(value, list):
        return ", ".join(map(str, value))
    if isinstance(value, bool):
        return "yes" if value else "no"
    return _number(value) if isinstance(value, float) else str(value)


def lesion_command(name: str, description: Mapping[str, Any]) -> str:
    """Return the command that makes lesions of a run.

    Args:
        name: RUN or RUN:SEED, as the commands take it.
        description: entries of ``settings.json``; what it leaves out is as usual.
    """
    defaults, words = LesionSettings(), ["bilateral-rl", "lesion", name]
    lesions = description.get("lesions")
    for lesion in lesions if isinstance(lesions, list) else ():
        words += ["--lesion", lesion]
    words += _protocol_options(description)
    if description.get("control") is False:
        words.append("--no-control")
    usual = {"profile": None, "spring": None, "trials": defaults.trials, "seed": defaults.seed, "weights": FINAL}
    for option, default in usual.items():
        value = description.get(option, default)
        if value != default:
            words += [f"--{option}", _number(value) if isinstance(value, float) else value]
    return shlex.join(map(str, words))


def _number(value: float) -> str:
    """The shortest text of a number."""
    return repr(value).removesuffix(".0")


def _protocol_options(description: Mapping[str, Any]) -> list[str]:
    """The options that ask for the protocols described."""
    try:
        names = [build(Protocol, values).name for values in description["protocols"]]
    except (KeyError, TypeError, UserError):  # nobody says, or not in words that are known
        return []
    if names == [protocol.name for protocol in DEFAULT_PROTOCOLS]:
        return []
    return ["--no-retrain"] if names == ["none"] else [word for name in names for word in ("--retrain", name)]
