"""``python -m bilateral_rl.zoo``: rl_zoo3's commands, with our algorithms, search spaces and hyperparameters."""

from __future__ import annotations

import argparse
import importlib
import runpy
import sys

import torch

from bilateral_rl.config.catalogue import check_choice
from bilateral_rl.io.errors import UserError, run_program
from bilateral_rl.zoo import ZOO_ALGORITHMS

COMMANDS = ("train", "enjoy", "record_video", "plot_train", "plot_from_file", "all_plots")
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
    torch.set_num_threads(1)  # networks this small only lose time to more; --num-threads still sets them
    if sys.argv[1] == "record_video":
        record_video()
    else:
        if sys.argv[1] in ("plot_train", "all_plots"):
            sys.argv[2:] = named_as_folders(sys.argv[2:])
        from rl_zoo3 import cli

        cli.main()


def record_video() -> None:
    """Run rl_zoo3's script of that name, which its command line leaves out.

    It has no ``--gym-packages``, without which nobody's own environment is found; here it has, as in ``enjoy``.
    """
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--gym-packages", nargs="+", default=[])
    options, sys.argv[1:] = parser.parse_known_args(sys.argv[2:])
    for package in options.gym_packages:
        importlib.import_module(package)
    sys.modules.pop("rl_zoo3.record_video", None)
    runpy.run_module("rl_zoo3.record_video", run_name="__main__")


def named_as_folders(arguments: list[str]) -> list[str]:
    """Return a command's arguments with environments named as rl_zoo3 names their folders, in which it looks for them.

    It plots nothing, and says nothing, for the names with a slash that its other commands take.
    """
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("-e", "--env", nargs="+", default=[])
    options, others = parser.parse_known_args(arguments)
    return [*others, "--env", *(name.replace("/", "-") for name in options.env)] if options.env else others


if __name__ == "__main__":
    run_program(main)
