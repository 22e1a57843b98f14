"""Trainings from Python: of every algorithm, from the start or from where one was saved."""

from __future__ import annotations

import shlex
import signal
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bilateral_rl.api.checks import SeedsLike, as_path, seeds_text, settings_by_name
from bilateral_rl.api.notes import tell
from bilateral_rl.api.progress import ProgressLike, TrainingProgress, console_of
from bilateral_rl.api.run import Run, find_run
from bilateral_rl.api.wording import in_python
from bilateral_rl.config.by_hand import check_by_hand
from bilateral_rl.config.code_tasks import allow_code, confirm_code
from bilateral_rl.config.parse import Values, nested
from bilateral_rl.config.resolve import check_penalty, resolve
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.config.seeds import parse_seeds
from bilateral_rl.config.tasks import TaskWords
from bilateral_rl.io.errors import Stopped, UserError
from bilateral_rl.io.yaml_files import read_settings
from bilateral_rl.training import run as training
from bilateral_rl.training.progress import UNWATCHED, Outcome

_RESUMED = ("timesteps", "epochs", "track", "device")
"""Settings that may change where a training goes on."""
_SIZES = ("model", "network.units", "network.layers")
"""Settings with which a network of other sizes would not fit."""


@in_python
def train(
    algo: str | None = None,
    model: str | None = None,
    task: TaskWords | None = None,
    *,
    timesteps: int | None = None,
    epochs: int | None = None,
    seeds: SeedsLike = None,
    profile: str | None = None,
    seed: int | None = None,
    n_envs: int | None = None,
    units: int | None = None,
    layers: int | None = None,
    threshold: float | None = None,
    device: str | None = None,
    init_from: str | Path | Run | None = None,
    track: bool | None = None,
    config: str | Path | Mapping[str, Any] | TrainConfig | None = None,
    settings: Mapping[str, Any] | None = None,
    out: str | Path = "runs",
    progress: ProgressLike = True,
) -> Run:
    """Train a model from scratch; called without arguments, cc_s learns to reach by PPO, in a few minutes.

    What is left out has the tuned default of the algorithm and task. ``config`` goes over the defaults, ``settings``
    over that, and the other arguments over both.

    Args:
        algo: "ppo" (the default), "a2c", "sac", "td3", or "bptt" (supervised, as in the paper).
        model: "uni_b", "uni_dl", "uni_ndl", "bi_ns", "bi_s", "cc_ns" or "cc_s" (the default).
        task: "random_reach" (the default), "hold_position", the name or YAML file of an experiment, an
            :class:`~bilateral_rl.envs.Experiment`, or a class of yours as "module:Class".
        timesteps: environment steps, over all arms (not bptt).
        epochs: largest number of epochs (bptt).
        seeds: networks to train: how many, of seeds ``seed`` and up; or which, as ``range(100, 130)``.
        profile: weight penalty, "paper" or "released" for its code's (bptt).
        seed: seed of weights, exploration and trials, of the first network.
        n_envs: arms simulated at once (not bptt).
        units: units per hidden layer, over both sides.
        layers: hidden layers.
        threshold: radius of the goal (m).
        device: "cpu", "cuda" or "cuda:N".
        init_from: a run whose network is the first one, whatever trained it; with its seed where it has several.
        track: whether Weights & Biases follows the training.
        config: settings of a YAML or JSON file, or ``config`` of another run.
        settings: any others by name, such as ``{"ppo.gamma": 0.9}`` or ``{"ppo": {"gamma": 0.9}}``.
        out: folder of all runs; this one becomes ``<out>/<task>/<model>-<algo>-<n>``.
        progress: whether a bar shows how it comes along, or the rich console where it does.

    Returns:
        The run. What a person should know of the training is a warning.

    Raises:
        UserError: a training that cannot be; nothing is left then.
        Stopped: somebody interrupted it; all is saved, and ``load(…).resume()`` goes on.
    """
    chosen = {
        "timesteps": timesteps, "epochs": epochs, "profile": profile, "seed": seed, "n_envs": n_envs,
        "device": None if device is None else str(device), "track": track,
        "init_from": init_from.name if isinstance(init_from, Run) else None if init_from is None else str(init_from),
        "network.units": units, "network.layers": layers, "trial.threshold": threshold,
    }  # fmt: skip
    layers_of_settings = [_configuration(config), settings_by_name("--set", settings)]
    outcome = start(algo, model, task, seeds_text(seeds), chosen, layers_of_settings, as_path("--out", out), progress)
    tell(outcome.notes)
    return concluded(outcome)


def start(
    algo: str | None,
    model: str | None,
    task: TaskWords | None,
    seeds: str | None,
    chosen: Mapping[str, Any],
    layers: list[Values],
    out: Path,
    progress: ProgressLike,
) -> Outcome:
    """Train from scratch.

    Args:
        algo: the algorithm; this and the next two may be None for what the settings say, or the defaults.
        model: the model.
        task: the task.
        seeds: as ``--seeds`` takes them.
        chosen: settings that have arguments of their own, by name; None where nothing was said.
        layers: nested dictionaries of settings below those; later ones win, and the last is the user's own.
        out: folder of all runs.
        progress: whether, or where, to show how it comes along.

    Raises:
        UserError: a training that cannot be.
    """
    allow_code([task, *(layer.get("task") for layer in layers[-1:])])  # not those of a file, which may be a stranger's
    named = {name: value for name, value in chosen.items() if value is not None}
    if seeds is not None:
        named |= parse_seeds(seeds, "--seed" if "seed" in named else "").settings
    by_hand = layers[-1]
    layers = [*layers, nested(named)]
    config = resolve(algo, task, layers, model=model)
    check_penalty(layers, config)
    check_by_hand(by_hand, config)
    return _run(training.prepare(config), out, progress)


def go_on(run: Run | str | Path, requested: Mapping[str, Any], progress: ProgressLike) -> Outcome:
    """Go on with a training.

    Args:
        run: the run, as a whole, or its folder.
        requested: settings by name; None where nothing was said. Few may change.
        progress: whether, or where, to show how it comes along.

    Raises:
        UserError: a training that cannot go on, or not so.
    """
    requested = dict(requested)
    task = requested.pop("task", None)
    _refuse_but(_RESUMED, requested, run)
    run = find_run(run)
    confirm_code(run.config.task, task, run)
    if run.only is not None:
        raise UserError(f"--resume goes on with the whole run: give it {run.path}, without :{run.only}.")
    values = run.config.to_values()
    allowed = [name for name in _RESUMED if name in values]
    _refuse_but(allowed, requested, run)
    if "track" in values:
        values["track"] = False  # the run may be somebody else's: who goes on with it says whether it is tracked
    config = resolve(None, None, [values | {name: requested[name] for name in allowed if requested[name] is not None}])
    return _run(training.prepare_resume(run.folder, config), run.path.parent.parent, progress)


def concluded(outcome: Outcome) -> Run:
    """Return the run of a training that came to its end.

    Raises:
        Stopped: somebody stopped it.
        SystemExit: the process was asked to terminate.
    """
    if outcome.stopped_by == signal.SIGTERM:
        sys.exit(128 + signal.SIGTERM)
    if outcome.stopped_by is not None:
        path = str(outcome.folder.path)
        raise Stopped(f"Stopped, and saved in {path}; `bilateral_rl.load({path!r}).resume()` goes on.")
    return Run(outcome.folder)


def _run(prepared: training.Prepared, out: Path, progress: ProgressLike) -> Outcome:
    console = console_of(progress)
    if console is None:
        return training.run(prepared, out, UNWATCHED)
    with TrainingProgress(prepared.config, console) as shown:
        if prepared.folder is None:  # what is saved may still be refused
            shown.announce()  # compiling the arm, the first time, takes a while
        return training.run(prepared, out, shown)


def _configuration(config: str | Path | Mapping[str, Any] | TrainConfig | None) -> Values:
    if isinstance(config, TrainConfig):
        return config.to_values()
    if config is None or isinstance(config, Mapping):
        return settings_by_name("--config", config)
    return read_settings(as_path("--config", config))


def _refuse_but(allowed: Sequence[str], requested: Mapping[str, Any], run: Run | str | Path) -> None:
    for name, value in requested.items():
        if value is not None and name not in allowed:
            flag = name.rpartition(".")[2].replace("_", "-")
            flags = ", ".join(f"--{one}" for one in allowed)
            named = run.name if isinstance(run, Run) else str(run)
            begin = f"`bilateral-rl train --init-from {shlex.quote(named)}`"
            if name in _SIZES:
                begin = "`bilateral-rl train`, without --init-from, as its network is of another size"
            raise UserError(
                f"A resumed run keeps its settings: --resume takes only {flags} here, not --{flag}. For other settings "
                f"begin a new run: {begin}."
            )
