"""What the arguments of a lesion study on retraining ask for, as protocols."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bilateral_rl.analysis.protocols import DEFAULT_PROTOCOLS, RETRAINED, Protocol
from bilateral_rl.api.checks import Names, names
from bilateral_rl.config.parse import build
from bilateral_rl.io.errors import UserError

_NONE = Protocol("none")


def chosen_protocols(retrain: Names, settings: Mapping[str, Any]) -> tuple[Protocol, ...]:
    """Return the protocols that were asked for, each once.

    Args:
        retrain: what each of them retrains, or a whole protocol by its name; None for the default ones.
        settings: fields of :class:`~bilateral_rl.analysis.protocols.Protocol` for all that retrain something; None
            where nothing was said.

    Raises:
        UserError: an unknown word, a number out of bounds, or options that contradict each other.
    """
    given = {name: value for name, value in settings.items() if value is not None}
    words = names("--retrain", retrain)
    protocols = [_protocol(word) for word in words] if words else [*DEFAULT_PROTOCOLS]
    if given and protocols == [_NONE] * len(protocols):
        raise UserError(
            f"{_option(next(iter(given)))} says how to retrain, but nothing is retrained; leave it out, or choose "
            "--retrain output, combination or everything."
        )
    return tuple(dict.fromkeys(_changed(protocol, given) for protocol in protocols))


def _protocol(word: str) -> Protocol:
    try:
        return Protocol.parse(word)
    except UserError:
        raise UserError(
            f"Unknown --retrain {word!r}; choose from {', '.join(RETRAINED)}, or give the name of a protocol as it "
            "stands in a lesions.csv."
        ) from None


def _changed(protocol: Protocol, given: Mapping[str, Any]) -> Protocol:
    """Return the protocol with the settings given."""
    if protocol == _NONE or not given:
        return protocol
    if protocol.name not in RETRAINED:
        raise UserError(
            f"--retrain {protocol.name} says all of how to retrain; leave out {_option(next(iter(given)))}, or shorten "
            f"it to --retrain {protocol.retrain}."
        )
    for name, value in given.items():  # one by one, so that the option is named
        try:
            build(Protocol, {"retrain": protocol.retrain, name: value})
        except UserError as error:
            raise UserError(f"{_option(name)}: {error}") from None
    return build(Protocol, {"retrain": protocol.retrain, **given})


def _option(name: str) -> str:
    return f"--retrain-{name.replace('_', '-')}"
