"""The columns of results that say what followed a lesion, for tests that make up tables."""

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.analysis.results import treatment

AS_TRAINED = treatment(Protocol("none"))
RETRAINED = treatment(Protocol("output"))


def treated(protocol="none", network="trained"):
    """The columns from ``network`` to ``trials``."""
    return treatment(Protocol.parse(protocol), network)
