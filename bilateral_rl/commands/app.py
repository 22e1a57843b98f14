"""The command line: options and their help. Each command is imported when it is called, so that help comes at once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from bilateral_rl import __version__
from bilateral_rl.io.errors import run_program
from bilateral_rl.io.terminal import Terminal
from bilateral_rl.vocabulary import TEST_SEED, TEST_TRIALS

app = typer.Typer(
    help="Two-hemisphere motor controllers on a six-muscle arm, trained with stable-baselines3.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
console = Terminal()

RUNS = Path("runs")
Run = Annotated[
    str, typer.Argument(help="A run folder, such as runs/random_reach/cc_s-ppo-1, or RUN:SEED for one seed of it.")
]
Out = Annotated[Path, typer.Option(help="Folder of all runs.")]
Trials = Annotated[int, typer.Option(help="Trials of each test.")]
TestSeed = Annotated[int, typer.Option(help="Seed of the trials; trial i is the first one of seed + i.")]
Weights = Annotated[str, typer.Option(help="final, best or step_…: which weights of the run.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Any setting of a run's config.yaml, such as ppo.gamma=0.9."),
]
TestTask = Annotated[
    str | None,
    typer.Option("--task", help="Test on this task, experiment, FILE.yaml or module:Class.", show_default="the run's"),
]
CodeTask = Annotated[
    str | None,
    typer.Option("--task", metavar="module:Class", help="Run the code of this class, which the run learned."),
]
TestSettings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Another setting of trials, such as trial.sensory_noise=0.01."),
]
SEEDS = "N|FIRST..LAST"
_RETRAINING = "What follows each lesion"
"""Where the options of retraining stand in the help of ``lesion``."""
Jobs = Annotated[int | None, typer.Option(help="Trainings at a time.", show_default="one a CPU")]
Ray = Annotated[
    str | None, typer.Option(metavar="ADDRESS|local", help="Hand the trainings to a Ray cluster (extra: ray).")
]


def _print_version(asked: bool) -> None:
    if asked:
        console.print(__version__, highlight=False)
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Take what stands before a command."""


@app.command()
def train(
    algo: Annotated[
        str | None, typer.Option(help="ppo, a2c, sac, td3, or bptt (supervised, as in the paper).", show_default="ppo")
    ] = None,
    model: Annotated[
        str | None, typer.Option(help="uni_b, uni_dl, uni_ndl, bi_ns, bi_s, cc_ns or cc_s.", show_default="cc_s")
    ] = None,
    task: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE.yaml|module:Class",
            help="random_reach, hold_position, two_reaches, reach_and_hold, two_holds, an experiment (see list), "
            "its file, or a class of yours.",
            show_default="random_reach",
        ),
    ] = None,
    timesteps: Annotated[
        int | None, typer.Option(help="Environment steps, over all arms (not bptt).", show_default="16000000 by ppo")
    ] = None,
    epochs: Annotated[int | None, typer.Option(help="Largest number of epochs (bptt).", show_default="100")] = None,
    seeds: Annotated[
        str | None,
        typer.Option(
            metavar=SEEDS,
            help="Networks to train in one run: how many, of seeds --seed and up, or which, such as 100..129.",
            show_default="1",
        ),
    ] = None,
    profile: Annotated[
        str | None,
        typer.Option(help="Weight penalty: paper, or released for its code's (bptt).", show_default="paper"),
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of weights, exploration and trials.", show_default="0")] = None,
    n_envs: Annotated[
        int | None, typer.Option(help="Arms simulated at once (not bptt).", show_default="1024 by ppo")
    ] = None,
    units: Annotated[
        int | None, typer.Option(help="Units per hidden layer, over both sides.", show_default="10; 20 for two arms")
    ] = None,
    layers: Annotated[int | None, typer.Option(help="Hidden layers.", show_default="2")] = None,
    threshold: Annotated[float | None, typer.Option(help="Radius of the goal (m).", show_default="0.05")] = None,
    device: Annotated[str | None, typer.Option(help="cpu, cuda or cuda:N.", show_default="cpu")] = None,
    init_from: Annotated[
        str | None, typer.Option(metavar="RUN[:SEED]", help="Begin with this run's network, whatever trained it.")
    ] = None,
    track: Annotated[
        bool | None,
        typer.Option("--track/--no-track", help="Log to Weights & Biases too (extra: track).", show_default="no"),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of all runs.", show_default="runs")] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            help="Settings from a YAML or JSON file. With another --task or --algo than that of a run's config.yaml, "
            "only what differs from the run's defaults is taken over."
        ),
    ] = None,
    overrides: Overrides = None,
    resume: Annotated[
        Path | None,
        typer.Option(help="Go on with this run; only --timesteps or --epochs, --device and --track go with it."),
    ] = None,
) -> None:
    """Train a model. The bare command trains cc_s to reach with PPO, in a few minutes."""
    from bilateral_rl.commands import train as command

    flags: dict[str, Any] = {
        "timesteps": timesteps, "epochs": epochs, "profile": profile,
        "seed": seed, "n_envs": n_envs, "device": device, "init_from": init_from, "track": track,
        "network.units": units, "network.layers": layers, "trial.threshold": threshold,
    }  # fmt: skip
    if resume is None:
        command.train(
            algo=algo,
            model=model,
            task=task,
            seeds=seeds,
            flags=flags,
            config_file=config,
            overrides=overrides or [],
            out=out or RUNS,
            console=console,
        )
    else:
        of_new_ones = {
            "algo": algo, "model": model, "task": task, "seeds": seeds, "config": config, "set": overrides or None,
            "out": out,
        }  # fmt: skip
        command.resume(path=resume, requested=flags | of_new_ones, console=console)


@app.command()
def evaluate(
    run: Run,
    trials: Trials = TEST_TRIALS,
    seed: TestSeed = TEST_SEED,
    deterministic: Annotated[bool, typer.Option(help="Act by the mean, not by sampling.")] = True,
    weights: Weights = "final",
    lesion: Annotated[str, typer.Option(help="Lesion every network that is tested.")] = "intact",
    task: TestTask = None,
    overrides: TestSettings = None,
    by: Annotated[
        str | None,
        typer.Option(
            metavar="WHAT",
            help="Take the trials apart: by target, condition, phase, hand, role, or hand,role.",
            show_default="not",
        ),
    ] = None,
    csv: Annotated[
        Path | None, typer.Option(help="Write one row a trial here, or what --by says; - is the terminal.")
    ] = None,
    json: Annotated[Path | None, typer.Option(help="Write the table here; - is the terminal.")] = None,
) -> None:
    """Test a trained model and print its measures at goal radii of 2, 3 and 5 cm and its own."""
    from bilateral_rl.commands import evaluate as command

    command.evaluate(
        run=run,
        trials=trials,
        seed=seed,
        deterministic=deterministic,
        weights=weights,
        lesion=lesion,
        task=task,
        overrides=overrides or [],
        by=by,
        csv=csv,
        json_file=json,
        console=console,
    )


@app.command()
def lesion(
    run: Run,
    lesions: Annotated[
        list[str] | None,
        typer.Option("--lesion", help="Only this one; may be repeated.", show_default="all that the model can have"),
    ] = None,
    retrain: Annotated[
        list[str] | None,
        typer.Option(
            metavar="WHAT",
            help="What adapts: none, output (layer), combination (its weights too) or everything; or a protocol's name "
            "in a lesions.csv. May be repeated.",
            show_default="none, output, everything",
            rich_help_panel=_RETRAINING,
        ),
    ] = None,
    no_retrain: Annotated[
        bool, typer.Option("--no-retrain", help="The same as --retrain none.", rich_help_panel=_RETRAINING)
    ] = False,
    retrain_epochs: Annotated[
        int | None, typer.Option(help="For so many epochs.", show_default="1", rich_help_panel=_RETRAINING)
    ] = None,
    retrain_learning_rate: Annotated[
        float | None,
        typer.Option(
            help="Learning rate of Adam.",
            show_default="the training's by bptt if it was constant, or 0.001",
            rich_help_panel=_RETRAINING,
        ),
    ] = None,
    retrain_optimizer: Annotated[
        str | None,
        typer.Option(
            help="fresh, or continued from the training (bptt).", show_default="fresh", rich_help_panel=_RETRAINING
        ),
    ] = None,
    retrain_trials: Annotated[
        str | None,
        typer.Option(
            help="new ones, or those of the training (bptt).", show_default="new", rich_help_panel=_RETRAINING
        ),
    ] = None,
    retrain_penalty: Annotated[
        str | None,
        typer.Option(
            help="Weight penalty: weights, activity or released.",
            show_default="that of a bptt run, or weights",
            rich_help_panel=_RETRAINING,
        ),
    ] = None,
    retrain_penalty_coefficient: Annotated[
        float | None,
        typer.Option(help="Its λ; 0 for none.", show_default="the run's, or the usual", rich_help_panel=_RETRAINING),
    ] = None,
    no_control: Annotated[
        bool,
        typer.Option(
            "--no-control",
            help="Leave out fresh networks, which tell what was kept from what is relearned.",
            rich_help_panel=_RETRAINING,
        ),
    ] = False,
    profile: Annotated[
        str | None,
        typer.Option(help="Combined lesions of the paper, or released for its code's.", show_default="the run's"),
    ] = None,
    spring: Annotated[
        float | None,
        typer.Option(
            help="Stiffness of the spring between two hands (N/m), in retraining and tests; 0 for none.",
            show_default="the run's",
        ),
    ] = None,
    trials: Trials = TEST_TRIALS,
    seed: TestSeed = TEST_SEED,
    weights: Weights = "final",
    task: CodeTask = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the results.", show_default="RUN-lesions")] = None,
) -> None:
    """Lesion a trained model in every way it can be, let it adapt, and test it beside a fresh one treated alike."""
    from bilateral_rl.commands import lesion as command

    settings: dict[str, Any] = {
        "epochs": retrain_epochs, "learning_rate": retrain_learning_rate, "optimizer": retrain_optimizer,
        "trials": retrain_trials, "penalty": retrain_penalty, "penalty_coefficient": retrain_penalty_coefficient,
    }  # fmt: skip
    command.lesion(
        run=run,
        lesions=lesions,
        retrain=retrain,
        no_retrain=no_retrain,
        settings=settings,
        control=not no_control,
        profile=profile,
        spring=spring,
        trials=trials,
        seed=seed,
        weights=weights,
        task=task,
        out=out,
        console=console,
    )


@app.command()
def compare(
    runs: Annotated[list[str], typer.Argument(metavar="RUN…", help="Two or more; or one, to compare its lesions.")],
    metrics: Annotated[
        list[str] | None,
        typer.Option("--metric", help="Such as effort; may be repeated.", show_default="the task's preferred one"),
    ] = None,
    retrain: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="What followed the lesions (of one), such as everything; may be repeated.",
            show_default="all that was tested",
        ),
    ] = None,
    trials: Annotated[int, typer.Option(help="Trials of each test (of models).")] = TEST_TRIALS,
    seed: Annotated[int, typer.Option(help="Seed of the trials (of models).")] = TEST_SEED,
    task: CodeTask = None,
    csv: Annotated[Path | None, typer.Option(help="Write one row a pair here; - is the terminal.")] = None,
) -> None:
    """Compare trained models, or the lesions of one: analysis of variance, pairwise tests, effect sizes."""
    from bilateral_rl.commands import compare as command

    command.compare_runs(
        runs=runs, metrics=metrics, protocols=retrain, trials=trials, seed=seed, task=task, csv=csv, console=console
    )


@app.command()
def render(
    runs: Annotated[list[str], typer.Argument(metavar="RUN…", help="One run or several side by side; RUN:SEED.")],
    out: Annotated[Path | None, typer.Option(help="An .mp4 or .gif file.", show_default="RUN….mp4")] = None,
    trials: Annotated[int, typer.Option(help="How many, one after another.")] = 4,
    seed: TestSeed = TEST_SEED,
    lesion: Annotated[str, typer.Option(help="Lesion every network shown.")] = "intact",
    weights: Weights = "final",
    slow_down: Annotated[int, typer.Option(help="Seconds of video for a second of the arm's, 2 to 20.")] = 4,
    size: Annotated[int, typer.Option(help="Height of each picture (pixels).")] = 480,
    task: TestTask = None,
    overrides: TestSettings = None,
) -> None:
    """Make a video of trained models doing the same trials, muscles colored by activation."""
    from bilateral_rl.commands import render as command

    command.render(
        runs=runs,
        out=out,
        trials=trials,
        seed=seed,
        lesion=lesion,
        weights=weights,
        slow_down=slow_down,
        size=size,
        task=task,
        overrides=overrides or [],
        console=console,
    )


@app.command()
def record(
    run: Run,
    out: Annotated[Path, typer.Option(help="A .csv, .npz, .parquet or .nc file (the last two: extra record).")],
    trials: Annotated[int, typer.Option(help="Trials of each network with each lesion.")] = 128,
    seed: TestSeed = TEST_SEED,
    lesions: Annotated[
        list[str] | None,
        typer.Option("--lesion", help="A lesion, or intact; may be repeated.", show_default="intact"),
    ] = None,
    task: TestTask = None,
    overrides: TestSettings = None,
    weights: Weights = "final",
) -> None:
    """Write what moved in trials, step by step, into a file: joints, hand, muscles, hidden activity, rewards."""
    from bilateral_rl.commands import record as command

    command.record(
        run=run,
        out=out,
        trials=trials,
        seed=seed,
        lesions=lesions or [],
        task=task,
        overrides=overrides or [],
        weights=weights,
        console=console,
    )


@app.command()
def reproduce(
    algo: Annotated[str, typer.Option(help="bptt, as the paper, or ppo, a2c, sac, td3.")] = "bptt",
    profile: Annotated[str, typer.Option(help="paper, or released for its code's losses and lesions.")] = "paper",
    models: Annotated[
        list[str] | None,
        typer.Option(help="Models, such as bi_s or bi_s,cc_s; may be repeated.", show_default="all"),
    ] = None,
    study: Annotated[str, typer.Option(help="paper, or two_arms for the claims on two arms, B1 to B6.")] = "paper",
    tasks: Annotated[
        list[str] | None,
        typer.Option(help="Tasks of the study, such as reach_and_hold; may be repeated.", show_default="all"),
    ] = None,
    seeds: Annotated[
        str | None,
        typer.Option(
            metavar=SEEDS,
            help="Networks of each model: how many, of seeds 0 and up, or which, such as 100..129.",
            show_default="10; 3 if quick",
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A preview: 3 seeds, short trainings.")] = False,
    jobs: Jobs = None,
    ray: Ray = None,
    overrides: Overrides = None,
    readings: Annotated[
        list[str] | None,
        typer.Option(
            metavar="all|NAME|FILE",
            help="Readings to judge by, such as everything-speed or a YAML file; may be repeated.",
            show_default="text and everything; of two arms, all that need no other trainings",
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the study.", show_default="runs/reproduce-…")] = None,
) -> None:
    """Reproduce the paper, or study two arms: seven models, lesions, statistics, figures, a report with verdicts."""
    from bilateral_rl.commands import reproduce as command

    command.reproduce(
        algo=algo,
        profile=profile,
        models=models,
        study=study,
        tasks=tasks,
        seeds=seeds,
        quick=quick,
        n_jobs=jobs,
        ray=ray,
        overrides=overrides or [],
        readings=readings,
        out=out,
        console=console,
    )


@app.command()
def sweep(
    grid: Annotated[
        list[str],
        typer.Option(metavar="KEY=V,V,…", help="A setting and its values; may be repeated. model and task are two."),
    ],
    algo: Annotated[str, typer.Option(help="bptt, ppo, a2c, sac or td3.")] = "bptt",
    seeds: Annotated[
        str | None,
        typer.Option(
            metavar=SEEDS,
            help="Networks at each point: how many, of seeds 0 and up, or which, such as 100..129.",
            show_default="1",
        ),
    ] = None,
    overrides: Overrides = None,
    metrics: Annotated[
        list[str] | None,
        typer.Option("--metric", help="To print, such as time_in_goal_1cm; may be repeated."),
    ] = None,
    trials: Trials = TEST_TRIALS,
    jobs: Jobs = None,
    ray: Ray = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the sweep.", show_default="runs/sweep")] = None,
) -> None:
    """Train at every point of a grid of settings, and show what came out side by side."""
    from bilateral_rl.commands import sweep as command

    command.sweep(
        algo=algo,
        grid=grid,
        seeds=seeds,
        overrides=overrides or [],
        metrics=metrics,
        trials=trials,
        n_jobs=jobs,
        ray=ray,
        out=out,
        console=console,
    )


@app.command("import")
def import_(
    model: Annotated[
        Path, typer.Argument(metavar="MODEL.zip", help="Saved by stable-baselines3, with a policy of bilateral_rl.")
    ],
    task: Annotated[
        str,
        typer.Option(
            metavar="NAME|FILE.yaml|module:Class",
            help="What it was trained for, such as random_reach or hold_position.",
        ),
    ],
    trust_pickle: Annotated[
        bool, typer.Option("--trust-pickle", help="Load it although that executes whatever its author wants.")
    ] = False,
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="What the file does not tell, such as trial.threshold=0.03."),
    ] = None,
    vec_normalize: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Statistics of observations, by VecNormalize.save, that the model was trained on; a pickle too.",
            show_default=False,
        ),
    ] = None,
    out: Out = RUNS,
) -> None:
    """Make a run of a model saved by stable-baselines3, so that every other command can take it."""
    from bilateral_rl.commands import import_model as command

    command.import_zip(
        path=model,
        task=task,
        trust_pickle=trust_pickle,
        overrides=overrides or [],
        vec_normalize=vec_normalize,
        out=out,
        console=console,
    )


@app.command()
def export(
    run: Run,
    out: Annotated[Path, typer.Option(help="The folder to write, which must not exist.", show_default=False)],
    trials: Trials = TEST_TRIALS,
    seed: TestSeed = TEST_SEED,
    weights: Weights = "final",
    task: CodeTask = None,
) -> None:
    """Write a run as a folder to publish: weights, settings and a model card with measures; no pickles."""
    from bilateral_rl.commands import export as command

    command.export(run=run, out=out, trials=trials, seed=seed, weights=weights, task=task, console=console)


@app.command("list")
def list_(out: Out = RUNS) -> None:
    """Show the models, tasks and algorithms there are, and the runs made so far."""
    from bilateral_rl.commands import list as command

    command.list_all(out, console)


def main() -> None:
    """Entry point of ``bilateral-rl``."""
    run_program(app)


if __name__ == "__main__":
    main()
