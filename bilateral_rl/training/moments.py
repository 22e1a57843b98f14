"""What the optimizer of a supervised training knew at its end, for a retraining that goes on from there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from torch import Tensor

from bilateral_rl.bptt.history import read_state
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.config.schema import BPTTConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import FINAL, RunFolder
from bilateral_rl.runs.policies import build_network, network_states


@dataclass(frozen=True)
class Moments:
    """What Adam knows of ``S`` networks at the end of their training."""

    first: Tensor
    """(S, width), first moments."""
    second: Tensor
    """(S, width), second moments."""
    steps: list[int]
    """Number of updates of each network."""


def trained_moments(folder: RunFolder, seeds: Sequence[int], weights: str = FINAL) -> Moments:
    """Read the moments of a run's networks.

    Args:
        folder: a supervised run.
        seeds: which of its networks.
        weights: which of the run's weights they are to go with.

    Raises:
        UserError: there is no training state, it is damaged, or it is not of these weights.
    """
    config, hint = folder.config(), "use --retrain-optimizer fresh"
    if not isinstance(config, BPTTConfig):
        raise UserError(f"{folder.path} was not trained by BPTT and has no optimizer to continue: {hint}.")
    if not folder.is_saved:
        raise UserError(f"{folder.path} has no training state, and so no optimizer to continue: {hint}.")
    layout = Layout(build_network(config))
    try:
        # Beside the trainer's state lie the logs' sizes and the blocks', under names with a dot.
        tensors = {name: tensor for name, tensor in folder.load_resume().items() if "." not in name}
        state = read_state(tensors, config, layout)
    except ValueError as error:
        raise UserError(f"The training state of {folder.path} is damaged: {error}; {hint}.") from None
    networks, indices = network_states(folder, weights), [config.all_seeds.index(seed) for seed in seeds]
    if not state.weights[indices].equal(layout.pack([networks[seed] for seed in seeds])):
        raise UserError(f"The training state of {folder.path} is not of its weights {weights!r}: {hint}.")
    steps = (state.epochs[indices] * config.updates_per_epoch).tolist()
    return Moments(state.first[indices], state.second[indices], steps)
