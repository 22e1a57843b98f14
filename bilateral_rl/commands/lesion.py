"""`bilateral-rl lesion`."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from bilateral_rl.api import lesioning
from bilateral_rl.api.protocols import chosen_protocols
from bilateral_rl.api.run import find_run
from bilateral_rl.commands.lesion_tables import print_lesions
from bilateral_rl.config.code_tasks import confirm_code
from bilateral_rl.config.parse import plain_values
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import INTACT
from bilateral_rl.study.lesion_description import lesion_command
from bilateral_rl.study.lesion_folder import RESULTS, lesion_metrics


def lesion(
    *,
    run: str,
    lesions: Sequence[str] | None,
    retrain: Sequence[str] | None,
    no_retrain: bool,
    settings: Mapping[str, Any],
    control: bool,
    profile: str | None,
    spring: float | None,
    trials: int,
    seed: int,
    weights: str,
    task: str | None,
    out: Path | None,
    console: Console,
) -> None:
    """Test a run's networks intact and lesioned; write beside the run, and print, what they do.

    Args:
        run: RUN, or RUN:SEED for one network of it.
        lesions: their names; None for all that the model can have.
        retrain: what adapts after each lesion; each state is tested once for each of them. None for the usual ones.
        no_retrain: whether nothing does.
        settings: how to retrain; None where nothing was said.
        control: whether fresh networks are treated alike.
        profile: whose combined lesions: "paper" or "released"; None for the run's profile.
        spring: stiffness of the spring between two hands in retraining and tests (N/m); None for that of the training.
        trials: number of trials of each test.
        seed: seed of the first trial.
        weights: which of the run's weights.
        task: the class that the runs learned, whose code may be run; None for nothing.
        out: folder of the results; None for the one beside the run.
        console: where to print.

    Raises:
        UserError: what cannot be lesioned or written; nothing is left then.
    """
    chosen = find_run(run)
    confirm_code(chosen.config.task, task, run)
    folder = out or chosen.lesions_folder

    if chosen.config.spec.architecture == "unilateral":
        console.print(
            f"[yellow]Note:[/yellow] {chosen.config.model} is one network and has no hemispheres to lesion; it is "
            "shown intact alone, before and after retraining (--no-retrain and --no-control leave that out).",
            highlight=False,
        )

    def show(made: lesioning.Lesions) -> None:
        title = f"{run} ({weights}), {trials} trials of seed {seed}"
        console.print(f"[italic]{escape(title)}", soft_wrap=True, highlight=False)
        print_lesions(made.results, lesion_metrics(made.config), console)
        if words := _spring_in_words(made, run, weights, folder):
            console.print(words, soft_wrap=True, highlight=False)

    made = lesioning.lesion(
        chosen,
        lesions,
        chosen_protocols(_words(retrain, no_retrain), settings),
        control=control,
        profile=profile,
        spring=spring,
        trials=trials,
        seed=seed,
        weights=weights,
        out=folder,
        progress=console,
        show=show,
    )
    if made.replaces_stale:
        console.print("[yellow]Note:[/yellow] these take the place of lesions of weights that the run no longer has.")
    path = escape(shlex.quote(str(folder)))
    console.print(f"Saved in [bold]{path}[/bold]: {RESULTS}, figures and tensorboard.", soft_wrap=True, highlight=False)


def _spring_in_words(made: lesioning.Lesions, run: str, weights: str, folder: Path) -> str:
    """Say what spring tied the hands and, where one did, how to test without; "" of one arm, or of no lesion."""
    if made.config.n_arms == 1 or set(made.results["lesion"]) == {INTACT}:
        return ""
    stiffness = made.config.trial.two_arms.spring.stiffness
    if not stiffness:
        return "" if made.settings.spring is None else "Tested without a spring between the hands."
    description = plain_values(made.settings) | {"weights": weights, "spring": 0.0}
    out = shlex.join(["--out", f"{folder}-spring-0"])  # results with another spring have a place of their own
    command = f"{lesion_command(run, description)} {out}"
    return f"Tested with a spring of {stiffness:g} N/m between the hands; without it: {escape(command)}"


def _words(retrain: Sequence[str] | None, no_retrain: bool) -> Sequence[str] | None:
    """Return what --retrain comes to beside --no-retrain. Raises UserError if they contradict each other."""
    if not no_retrain:
        return retrain
    if others := [word for word in retrain or () if word != "none"]:
        raise UserError(f"--no-retrain leaves nothing for --retrain {others[0]} to do; leave one of them out.")
    return ["none"]
