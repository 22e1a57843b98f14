"""What a person should know if one side of a trained network has fallen silent."""

from __future__ import annotations

from collections.abc import Mapping

from bilateral_rl.analysis.modulation import SideModulation
from bilateral_rl.config.schema import BPTTConfig, TrainConfig
from bilateral_rl.vocabulary import Side, group_penalties, path_names


def silence_notes(modulation: SideModulation, weights: Mapping[str, float], config: TrainConfig) -> list[str]:
    """Return a sentence for each side that is silent: how much it supplies, why, and what may be done.

    Args:
        modulation: what the sides supply at the end.
        weights: their combination weights, at the end, as ``MotorNetwork.combination_weights`` names them.
        config: of the training.
    """
    return [_note(side, modulation, weights, config) for side in modulation.silent]


def _note(side: Side, modulation: SideModulation, weights: Mapping[str, float], config: TrainConfig) -> str:
    own = [path for path, (_, of) in path_names(modulation.n_arms).items() if of == side]
    shares = [modulation.percent[path] for path in own if modulation.modulation[path]]
    if not shares:
        supplied = "it does not move the commands"
    elif modulation.n_arms == 1:
        supplied = f"it supplies {shares[0]:.1f} % of the commands' modulation"
    else:
        supplied = f"it supplies at most {max(shares):.1f} % of the modulation of either arm's commands"
    why = ", as its combination weight is 0" if not any(weights.get(path) for path in own) else ""
    trained = config.n_arms == 1 or config.network.trained_combination
    return (
        f"The {side.replace('_', '-')} side is silent: {supplied}{why}. Tensorboard shows under contribution/"
        f"{' and combination/' if trained else ''} since when{_cure(side, config)}."
    )


def _cure(side: Side, config: TrainConfig) -> str:
    """Name the setting that may keep a side alive: the weight penalty, where it acts on that side; else what to try."""
    name, coefficient = _penalty(config)
    weights = group_penalties(config.spec.loss, weights=config.trial.losses.penalties)
    if coefficient == 0 or weights[side] == 0:
        return "; other seeds show whether it is this network's alone"
    return f"; a smaller {name} than {coefficient:g} may keep it alive"


def _penalty(config: TrainConfig) -> tuple[str, float]:
    """Return the name and the value of the setting that is λ."""
    name = "penalty_coefficient" if isinstance(config, BPTTConfig) else "weight_penalty"
    return f"{config.algo}.{name}", config.penalty_coefficient
