"""A run in Python: what it is, and what can be done with it. What a verb takes is imported when it is called."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from bilateral_rl.api.checks import Names, as_path, settings_by_name, whole
from bilateral_rl.api.notes import tell
from bilateral_rl.api.wording import in_python
from bilateral_rl.config.code_tasks import confirm_code
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.config.tasks import TaskWords
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.text import seed_range
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.policies.lesions import INTACT
from bilateral_rl.runs.folder import FINAL, RunFolder
from bilateral_rl.runs.policies import load_policies, parse_run
from bilateral_rl.vocabulary import TEST_SEED, TEST_TRIALS

if TYPE_CHECKING:
    import pandas as pd

    from bilateral_rl.analysis.recording import Recording
    from bilateral_rl.api.progress import ProgressLike


@dataclass(frozen=True)
class Run:
    """A run, or the network of one seed of it; :func:`load` makes one of a folder.

    Its folder is only read, but by :meth:`resume`. Wherever a number of ``trials`` and a ``seed`` are taken, trial i is
    the first one of ``seed + i``, and the defaults are those of all commands and studies.
    """

    folder: RunFolder
    """What lies in the run's folder."""
    only: int | None = None
    """The seed whose network it is about; None for all that the run has."""

    @property
    def path(self) -> Path:
        """The run's folder."""
        return self.folder.path

    @property
    def name(self) -> str:
        """RUN or RUN:SEED, as commands and :func:`load` take it."""
        return str(self.path) if self.only is None else f"{self.path}:{self.only}"

    @property
    def config(self) -> TrainConfig:
        """Every setting of the training, as it is in ``config.yaml``: such as ``config.trial.threshold`` (m)."""
        return self.folder.config()

    @property
    def seeds(self) -> list[int]:
        """Seeds of its networks."""
        return self.config.all_seeds if self.only is None else [self.only]

    @property
    def status(self) -> dict[str, Any]:
        """``state`` ("running", "finished", "interrupted", "failed", "imported"), and how far the training came.

        That is ``timesteps`` of reinforcement learning or ``epochs`` of supervised training, of the seed that came
        furthest. Empty if the training has not begun.
        """
        return self.folder.status()

    @property
    def lesions_folder(self) -> Path:
        """Where ``bilateral-rl lesion`` keeps its results, and :func:`compare` of one run looks for them."""
        from bilateral_rl.study.lesion_folder import LesionFolder

        return LesionFolder.beside(self.folder, self.only).path

    def __str__(self) -> str:
        return self.name

    def __repr__(self) -> str:
        config = self.config
        what = f"{config.model} learned {config.task} by {config.algo}, {seed_range(self.seeds)}"
        return f"Run({self.name!r}: {what}, {self.status.get('state', 'never saved')})"

    @in_python
    def policy(self, seed: int | None = None, lesion: str = INTACT, weights: str = FINAL) -> MotorPolicy:
        """Return a network as a policy of stable-baselines3, ready for ``policy.predict(observation)``.

        It is a copy of its own: a lesion stays, whatever else is done with the run, until
        ``policy.motor_network.set_lesion`` sets another.

        Args:
            seed: seed of the network; it may be left out where there is one only.
            lesion: "intact", or the name of a lesion that the model can have.
            weights: "final", "best" or "step_…": which of the run's weights.

        Raises:
            UserError: several networks and no seed, or a seed, lesion or weights that there are not.
        """
        from bilateral_rl.runs.lesions import lesion_of

        if seed is None and len(self.seeds) > 1:
            raise UserError(f"{self.name} has {seed_range(self.seeds)}: say which one, as seed={self.seeds[0]}.")
        chosen = self.seeds[0] if seed is None else whole("--seed", seed)
        if chosen not in self.seeds:
            raise UserError(f"{self.name} has no seed {chosen}; it has {seed_range(self.seeds)}.")
        (policy,) = load_policies(self.folder, weights, chosen).values()
        policy.motor_network.set_lesion(lesion_of(self.folder, self.config, policy.motor_network, lesion))
        return policy

    @in_python
    def evaluate(
        self,
        trials: int = TEST_TRIALS,
        *,
        seed: int = TEST_SEED,
        lesion: str = INTACT,
        task: TaskWords | None = None,
        settings: Mapping[str, Any] | None = None,
        deterministic: bool = True,
        weights: str = FINAL,
        by: Literal["seed", "trial", "target", "condition", "phase", "hand", "role", "hand,role"] = "seed",
    ) -> pd.DataFrame:
        """Test the networks, and return their measures.

        Args:
            trials: number of trials of each network.
            seed: seed of the first trial.
            lesion: "intact", or the name of a lesion that the model can have.
            task: another task than the run's, an experiment or its file; or the run's own class, as "module:Class".
            settings: other settings of trials than the run's, such as ``{"trial.sensory_noise": 0.01}``.
            deterministic: whether policies act by the mean of their actions, without exploration.
            weights: "final", "best" or "step_…": which of the run's weights.
            by: "seed" for means over the trials, "trial" for a row a trial; of experiments also "target", "condition"
                or "phase" (before and after the cue); of two arms "hand", "role" or "hand,role".

        Returns:
            By seed, a row for each network (``seed``) and radius of the goal (``threshold_m``: 2, 3 and 5 cm, and that
            of the test), with columns ``goal_completion_percent``, ``speed_to_goal_cm_per_step`` (NaN where no goal was
            reached), ``time_in_goal_steps``, ``final_error_cm``, ``return_dominant`` and ``return_non_dominant``; of
            networks with two hemispheres also what each supplies to the muscles, before the sigmoid:
            ``contribution_…``, ``contribution_percent_…`` and ``contribution_constant_…``.

            By trial, a row a trial at the radius of the test, in SI units: ``trial``, ``threshold_m``,
            ``goal_completion`` (0 or 1), ``speed_to_goal_m_per_step``, ``time_in_goal_steps``, ``final_error_m``,
            ``start_distance_m``, both returns, ``start_x_m``, ``target_x_m``, ``load_x_N`` and the same along y, of
            experiments ``condition``, ``target_index`` and ``onset_step`` (of the cue or the jump), and ``seed``. Of
            two arms it is a row a hand, with ``hand`` ("dominant", "non_dominant") and ``role`` ("reach", "hold"), how
            straight and how far it went or how steadily it kept its place, and places and loads are in the frame of the
            body, whose midline is x = 0.

            By target or condition, a row a network and listed target (``target``, its index, and ``target_angle_deg``)
            or condition of the trials (``condition``: "field", "null_field", "channel", "no_go", "jump", "pulse", or
            several joined by "+"), with ``trials``, how many, and a column for every metric of the task, by its name
            and in its unit. By phase, ``phase`` ("hold" before the cue, "reach" from it on), ``trials``, ``error_cm``,
            ``speed_cm_per_s``, ``peak_speed_cm_per_s``, ``effort_per_s`` and ``force_N``, means over its steps.

            By hand, by role, or by both, a row a network and ``hand``, or ``role``, with ``trials``, how many hands,
            and a column for every metric of the task, NaN where it means nothing for the role.

            All end with ``lesion``, ``task`` and a column for each setting that is another than the run's. Trials
            without a cue count in no mean of what is reached.

        Raises:
            UserError: what cannot be tested so.
        """
        from bilateral_rl.analysis.breakdowns import BREAKDOWNS
        from bilateral_rl.api.evaluation import evaluate

        choices = ("seed", "trial", *BREAKDOWNS)
        if by not in choices:
            raise UserError(f"--by must be one of {', '.join(choices)}, got {by!r}.")
        evaluation = evaluate(
            self, trials, seed, lesion=lesion, task=task, settings=settings_by_name("--set", settings),
            deterministic=deterministic, weights=weights,
        )  # fmt: skip
        tell(evaluation.under.notes)
        if by == "seed":
            return evaluation.by_seed()
        return evaluation.by_trial() if by == "trial" else evaluation.taken_apart(by)

    @in_python
    def record(
        self,
        trials: int = 128,
        *,
        seed: int = TEST_SEED,
        lesion: Names = INTACT,
        task: TaskWords | None = None,
        settings: Mapping[str, Any] | None = None,
        weights: str = FINAL,
        progress: ProgressLike = True,
    ) -> Recording:
        """Record everything that moves in trials of the networks, step by step.

        ``recording["hand"]`` is an array (trials, moments, 2) (m), ``recording.frame()`` a table with a row a trial and
        moment, ``recording.save("reaches.parquet")`` a file. All is kept in memory, 25 kB a trial of 50 steps;
        :meth:`record_to` writes a file of any size.

        Args:
            trials: number of trials of each network with each lesion.
            seed: seed of the first trial.
            lesion: "intact", or the name of a lesion, or several, each of which every network has in turn.
            task: another task than the run's, an experiment or its file; or the run's own class, as "module:Class".
            settings: other settings of trials than the run's, such as ``{"trial.sensory_noise": 0.01}``.
            weights: "final", "best" or "step_…": which of the run's weights.
            progress: whether a bar shows how it comes along, or the rich console where it does.

        Raises:
            UserError: what cannot be recorded so.
        """
        from bilateral_rl.analysis.recording import Recording
        from bilateral_rl.api.recording import parts_of, recorder_of

        recorder = recorder_of(self, trials, seed, lesion, task, settings_by_name("--set", settings), weights)
        recording = Recording.join(parts_of(recorder, progress))
        tell(recorder.conditions.notes)
        return recording

    @in_python
    def record_to(
        self,
        out: str | Path,
        trials: int = 128,
        *,
        seed: int = TEST_SEED,
        lesion: Names = INTACT,
        task: TaskWords | None = None,
        settings: Mapping[str, Any] | None = None,
        weights: str = FINAL,
        progress: ProgressLike = True,
    ) -> Path:
        """Write what :meth:`record` records into a file, part by part, so that it may be larger than the memory.

        Args:
            out: a .csv, .npz, .parquet or .nc file; an earlier one is replaced.
            trials: number of trials of each network with each lesion.
            seed: seed of the first trial.
            lesion: "intact", or the name of a lesion, or several, each of which every network has in turn.
            task: another task than the run's, an experiment or its file; or the run's own class, as "module:Class".
            settings: other settings of trials than the run's, such as ``{"trial.sensory_noise": 0.01}``.
            weights: "final", "best" or "step_…": which of the run's weights.
            progress: whether a bar shows how it comes along, or the rich console where it does.

        Returns:
            The path of the file.

        Raises:
            UserError: what cannot be recorded so, or a file that cannot be written; none is left then.
        """
        from bilateral_rl.api.recording import record_to

        path, fixed = as_path("--out", out), settings_by_name("--set", settings)
        recorder = record_to(path, self, trials, seed, lesion, task, fixed, weights, progress)
        tell(recorder.conditions.notes)
        return path

    @in_python
    def lesion(
        self,
        lesions: Names = None,
        retrain: Names = None,
        *,
        retrain_epochs: int | None = None,
        retrain_learning_rate: float | None = None,
        retrain_optimizer: str | None = None,
        retrain_trials: str | None = None,
        retrain_penalty: str | None = None,
        retrain_penalty_coefficient: float | None = None,
        control: bool = True,
        profile: str | None = None,
        spring: float | None = None,
        trials: int = TEST_TRIALS,
        seed: int = TEST_SEED,
        weights: str = FINAL,
        task: str | None = None,
        out: str | Path | None = None,
        progress: ProgressLike = True,
    ) -> pd.DataFrame:
        """Test the networks intact and after each lesion, without and with adaptation to it, beside fresh networks.

        Args:
            lesions: one name or several; None for all that the model can have. The intact network always comes first.
            retrain: what adapts: "none", "output" (the output layer), "combination" (its weights too) or "everything",
                or a protocol by the name that it has in the table; one or several. None for "none", "output" and
                "everything".
            retrain_epochs: for so many epochs; None for one.
            retrain_learning_rate: learning rate of Adam; None for that of a supervised run in which it stayed the same,
                or 0.001.
            retrain_optimizer: "fresh", or "continued" from a supervised training; None for fresh.
            retrain_trials: "new" ones, or those of a supervised "training"; None for new.
            retrain_penalty: weight penalty, "weights", "activity" or "released"; None for the run's own, or weights.
            retrain_penalty_coefficient: its λ; None for that of a supervised run, or the usual one of the task.
            control: whether fresh networks are treated alike, to tell what was kept from what is relearned.
            profile: combined lesions of the "paper" or of its "released" code; None for the run's.
            spring: stiffness of the spring between two hands (N/m), in retraining and tests; 0 for none, None for that
                of the training.
            trials: number of trials of each test.
            seed: seed of the first trial.
            weights: "final", "best" or "step_…": which of the run's weights.
            task: of a run that learned a class of yours, that class, as "module:Class", whose code is then run.
            out: folder for the table, figures and tensorboard, such as :attr:`lesions_folder`; None for none.
            progress: whether a bar shows how it comes along, or the rich console where it does.

        Returns:
            The long table of :mod:`bilateral_rl.analysis.results`: a row a value, with columns ``model``, ``task``,
            ``algo``, ``seed``, ``lesion``, ``network`` ("trained", or "fresh" for the control), ``protocol``, what that
            came to (``retrain``, ``epochs``, ``learning_rate``, ``penalty``, ``penalty_coefficient``, ``optimizer``,
            ``trials``), ``metric`` and ``value``, the mean over a network's trials in the metric's unit.

        Raises:
            UserError: what cannot be lesioned or written; nothing is left then.
        """
        from bilateral_rl.api.lesioning import lesion
        from bilateral_rl.api.protocols import chosen_protocols

        confirm_code(self.config.task, task, self)
        adapting = {
            "epochs": retrain_epochs, "learning_rate": retrain_learning_rate, "optimizer": retrain_optimizer,
            "trials": retrain_trials, "penalty": retrain_penalty, "penalty_coefficient": retrain_penalty_coefficient,
        }  # fmt: skip
        return lesion(
            self, lesions, chosen_protocols(retrain, adapting), control=control, profile=profile, spring=spring,
            trials=trials, seed=seed, weights=weights, out=out, progress=progress,
        ).results  # fmt: skip

    @in_python
    def export(
        self,
        out: str | Path,
        *,
        trials: int = TEST_TRIALS,
        seed: int = TEST_SEED,
        weights: str = FINAL,
        task: str | None = None,
    ) -> Run:
        """Write the networks as a folder to publish: weights, settings, how they learned, and a model card; no pickles.

        :func:`load` and every command take the folder as they take a run.

        Args:
            out: the folder to write; it must not exist, or be empty.
            trials: number of trials of each network, from which the model card has its measures.
            seed: seed of the first trial.
            weights: "final", "best" or "step_…": which of the run's weights.
            task: of a run that learned a class of yours, that class, as "module:Class", whose code is then run.

        Returns:
            The run that the folder is.

        Raises:
            UserError: what cannot be tested or written; nothing is left then.
        """
        from bilateral_rl.api.exporting import export

        confirm_code(self.config.task, task, self)
        return export(self, out, trials=trials, seed=seed, weights=weights)

    @in_python
    def curves(self) -> pd.DataFrame:
        """Return how the networks learned; :func:`plot_curves` draws it.

        Returns:
            Columns ``model``, ``task``, ``algo`` and ``seed``; then, of reinforcement learning, a row an evaluation:
            ``timesteps`` (environment steps of the seed), ``goal_completion_percent``, ``speed_to_goal_cm_per_step``,
            ``time_in_goal_steps`` and ``final_error_cm``, at the run's own radius of the goal, returns, and what each
            side supplies. Of supervised training a row an epoch: ``epoch``, the loss of each stream, the gradient's
            norm of each group of parameters, ``validation_loss``, and the same measures on the validation trials.

        Raises:
            UserError: the run does not say, as one that was imported, or its table is damaged.
        """
        from bilateral_rl.api.learning import learning_curves

        return learning_curves(self)

    @in_python
    def blocks(self) -> pd.DataFrame:
        """Return how the networks adapted to the field of an experiment, block by block, in trials without learning.

        Returns:
            A row for each network (``seed``), ``block`` and ``condition``, with ``done``, the updates (of supervised
            training) or environment steps until then. Block 0 is before any learning. The condition is "field",
            "null" (without it: what is left there is the after-effect; ``blocks.csv`` writes "null_field"), or
            "channel" (in walls along the straight path). The measures, in the units of the metrics of these names:
            ``goal_completion`` (%) within the run's own threshold, ``final_error``, ``perpendicular_deviation``,
            ``signed_deviation`` and ``deviation_at_peak_speed`` (cm, to the left of the way to the target is positive);
            ``channel_compensation`` (1: the hand presses on the walls with the force that would cancel the field) and
            ``channel_peak_force`` (N), both NaN but in the channel. Of two arms they are of both hands, and of each by
            itself as ``final_error_of_dominant``. ``algo``, ``task`` and ``model`` come first.

        Raises:
            UserError: a run without blocks, or a damaged table.
        """
        from bilateral_rl.api.learning import adaptation_by_blocks

        return adaptation_by_blocks(self)

    @in_python
    def render(
        self,
        out: str | Path | None = None,
        *,
        trials: int = 4,
        seed: int = TEST_SEED,
        lesion: str = INTACT,
        weights: str = FINAL,
        slow_down: int = 4,
        size: int = 480,
        task: TaskWords | None = None,
        settings: Mapping[str, Any] | None = None,
        progress: ProgressLike = True,
    ) -> Path:
        """Make a video of the network, as :func:`render` does of several runs side by side.

        Args:
            out: an .mp4 or .gif file; None for one beside the run's folder.
            trials: how many, one after another.
            seed: seed of the first trial.
            lesion: "intact", or the name of a lesion.
            weights: "final", "best" or "step_…": which of the run's weights.
            slow_down: seconds of video for a second of the arm's.
            size: side of the picture (pixels, even).
            task: another task than the run's, an experiment or its file; or the run's own class, as "module:Class".
            settings: other settings of trials than the run's, such as ``{"trial.two_arms.spring.stiffness": 0}``.
            progress: whether a bar shows how it comes along, or the rich console where it does.

        Returns:
            The path of the video.

        Raises:
            UserError: what cannot be shown or written.
        """
        from bilateral_rl.api.rendering import make_video

        changed = settings_by_name("--set", settings)
        video = make_video([self], out, trials, seed, lesion, weights, slow_down, size, task, changed, progress)
        tell(video.notes)
        return video.path

    @in_python
    def resume(
        self,
        timesteps: int | None = None,
        epochs: int | None = None,
        *,
        device: str | None = None,
        track: bool | None = None,
        task: str | None = None,
        progress: ProgressLike = True,
    ) -> Run:
        """Go on with the training where it was saved, to its end or to a later one.

        On the same machine and with the same total it ends with the bits of a training that was never stopped.

        Args:
            timesteps: environment steps in all; None for as many as before (not of supervised training).
            epochs: largest number of epochs in all, likewise (of supervised training).
            device: "cpu", "cuda" or "cuda:N"; None for the one before.
            track: whether Weights & Biases follows it; None for no.
            task: of a run that learned a class of yours, that class, as "module:Class", whose code is then run.
            progress: whether a bar shows how it comes along, or the rich console where it does.

        Returns:
            The same run, trained further.

        Raises:
            UserError: a training that cannot go on, or not so.
            Stopped: somebody interrupted it; all is saved.
        """
        from bilateral_rl.api.training import concluded, go_on

        requested = {"timesteps": timesteps, "epochs": epochs, "device": device, "track": track, "task": task}
        outcome = go_on(self, requested, progress)
        tell(outcome.notes)
        return concluded(outcome)


@in_python
def load(run: str | Path | Run, seed: int | None = None) -> Run:
    """Return a run that has been made, by :func:`train` or by a command.

    Args:
        run: its folder, such as "runs/random_reach/cc_s-ppo-1", or "runs/random_reach/cc_s-bptt-1:3" for one seed.
        seed: the one seed that it is to be about; None for all, or for that in RUN:SEED.

    Raises:
        UserError: there is no run there, it is damaged, or it has no such seed.
    """
    found = find_run(run)
    return found if seed is None else one_seed(found.folder, whole("--seed", seed))


def find_run(run: str | Path | Run) -> Run:
    """Return the run that is meant. Raises UserError for what is no run, or has not the seed that is named."""
    if isinstance(run, Run):
        return run
    if not isinstance(run, (str, Path)):
        raise UserError(f"A run is named by its folder, such as runs/random_reach/cc_s-ppo-1, not by {run!r}.")
    folder, seed = parse_run(str(Path(run).expanduser()))
    return Run(folder) if seed is None else one_seed(folder, seed)


def one_seed(folder: RunFolder, seed: int) -> Run:
    """Return the network of one seed. Raises UserError for a seed that the run has not."""
    seeds = folder.config().all_seeds
    if seed not in seeds:
        raise UserError(f"{folder.path} has no seed {seed}; it has {seed_range(seeds)}.")
    return Run(folder, seed)
