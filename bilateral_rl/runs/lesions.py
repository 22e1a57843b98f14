"""The lesions that the networks of a run can have."""

from __future__ import annotations

from bilateral_rl.config.catalogue import check_choice
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import INTACT, LESIONS, LESIONS_OF, NO_LESION, Lesion
from bilateral_rl.policies.motor_network import MotorNetwork
from bilateral_rl.runs.folder import RunFolder


def lesion_of(folder: RunFolder, config: TrainConfig, network: MotorNetwork, name: str) -> Lesion:
    """Return the lesion called ``name``, or "intact", as the run's profile has it.

    Raises:
        UserError: there is no such lesion, or ``network`` cannot have it.
    """
    check_choice("lesion", name, [INTACT, *LESIONS])
    have = (INTACT, *network.available_lesions())
    if name not in have:
        raise UserError(
            f"{folder.path} is {network.architecture} and cannot have the lesion {name}; choose from {', '.join(have)}."
        )
    return NO_LESION if name == INTACT else LESIONS_OF[config.lesion_profile][name]
