"""``python -m bilateral_rl.zoo``: rl_zoo3's commands, with our algorithms, search spaces and hyperparameters."""

from __future__ import annotations

import sys

import torch

from bilateral_rl.config.catalogue import check_choice
from bilateral_rl.io.errors import UserError, run_program
from bilateral_rl.zoo import ZOO_ALGORITHMS

COMMANDS = ("train", "enjoy", "plot_train", "plot_from_file", "all_plots")
_EXAMPLE = "python -m bilateral_rl.zoo train --algo hemispheric_ppo --env bilateral_rl/RandomReach-v0"


def register() -> None:
    """Make our algorithms known to rl_zoo3, wherever it looks them up. Raises UserError if it is not installed."""
    try:
        import rl_zoo3
    except ModuleNotFoundError as error:
        if error.name != "rl_zoo3":
            raise
        raise UserError('rl_zoo3 is not installed; get it with `pip install -c constraints.txt -e ".[zoo]"`.') from None
    import rl_zoo3.train
    from rl_zoo3.hyperparams_opt import HYPERPARAMS_CONVERTER, HYPERPARAMS_SAMPLER

    from bilateral_rl.zoo.experiment import Experiment
    from bilateral_rl.zoo.search_spaces import CONVERTERS, SAMPLERS

    rl_zoo3.ALGOS.update(ZOO_ALGORITHMS)
    HYPERPARAMS_SAMPLER.update(SAMPLERS)
    HYPERPARAMS_CONVERTER.update(CONVERTERS)
    rl_zoo3.train.ExperimentManager = Experiment  # type: ignore[attr-defined]


def main() -> None:
    """Run the command that the command line names. Raises UserError for an unknown one, or without rl_zoo3."""
    if len(sys.argv) < 2:
        raise UserError(f"Say what to do, such as `{_EXAMPLE}`.")
    check_choice("command", sys.argv[1], COMMANDS)
    register()
    from rl_zoo3 import cli

    torch.set_num_threads(1)  # networks this small only lose time to more; --num-threads still sets them
    cli.main()


if __name__ == "__main__":
    run_program(main)
