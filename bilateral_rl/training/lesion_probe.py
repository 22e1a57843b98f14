"""A callback of stable-baselines3 that tests every lesion while a policy is being trained."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path

import pandas as pd
from stable_baselines3.common.logger import Figure as LoggedFigure
from stable_baselines3.common.logger import TensorBoardOutputFormat

from bilateral_rl.analysis.floor import AT_FLOOR, is_above
from bilateral_rl.analysis.metrics import find_metric, preferred_metric
from bilateral_rl.analysis.results import FRESH, TRAINED
from bilateral_rl.analysis.specialization import ALONE, specialization_index
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.config.schema import EvaluationConfig, RLConfig
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.tasks import TaskLike, make_task
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import replacing
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.policies.lesions import INTACT
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.training.callbacks import BetweenIterations
from bilateral_rl.training.fresh_networks import fresh_copy
from bilateral_rl.training.probe_table import COLUMNS, MEASURES, OF_HANDS, PROBE, read_probe
from bilateral_rl.training.schedule import Schedule

FIGURE = "specialization_over_training"
_JUDGED = {"goal_completion": "goal_completion_percent", "time_in_goal": "time_in_goal_steps"}
"""The measure by which a task is judged."""


class LesionProbe(BetweenIterations):
    """Test a policy intact and after each lesion it can have, every so many environment steps of any training.

    The deterministic policy does the same trials in each state. Lesions leave the weights as they are, and no random
    stream of the training is touched: it goes as it would without. Every measure is logged as
    ``lesions_<measure>/<state>``, and the specialization index
    (:func:`~bilateral_rl.analysis.specialization.specialization_index`) as ``specialization/<metric>``; tensorboard's
    custom scalars show the states of a measure in one chart. The control, a freshly initialized network of the same
    kind, is tested once, at the start. Where neither side alone does better than it
    (:func:`~bilateral_rl.analysis.floor.is_above`), the index means nothing: then it is "at the floor".

    Args:
        task: which task.
        settings: how trials run; None for the task's as it is.
        every: environment steps between probes, whatever the number of environments; the first one is at the start,
            and one more comes at the end.
        folder: takes ``lesion_probe.csv`` and, at the end, a figure; None for the logger alone. A training that goes on
            from a saved state keeps the rows up to it, another one begins anew.
        trials: of each state.
        seed: of the trials; trial i is the first one of seed + i.
        device: where the arms are simulated.
        name: of the model, in the figure; None for that of its architecture.

    Raises:
        UserError: ``every`` or ``trials`` below 1, an unknown task; and when the training starts, a policy without
            hemispheres or a damaged ``lesion_probe.csv``.
    """

    def __init__(
        self,
        task: TaskLike,
        settings: TrialSettings | None = None,
        every: int = 500_000,
        folder: str | Path | None = None,
        trials: int = EvaluationConfig.trials,
        seed: int = EvaluationConfig.seed,
        device: str = "cpu",
        name: str | None = None,
    ) -> None:
        super().__init__(every)
        if min(every, trials) < 1:
            raise UserError(f"A lesion probe needs every and trials to be at least 1, got {every} and {trials}.")
        try:
            made = make_task(task)
        except ValueError as error:
            raise UserError(str(error)) from None
        settings = settings or TrialSettings(**made.trial)
        self._metric = find_metric(preferred_metric(made, settings.threshold))
        self._evaluator = Evaluator(made, settings, trials, seed, device)
        self._task, self._threshold, self._name = made, settings.threshold, name
        self._path = None if folder is None else Path(folder) / PROBE
        self._table = pd.DataFrame(columns=list(COLUMNS))

    @property
    def table(self) -> pd.DataFrame:
        """A row a step and state: ``network``, ``timesteps``, ``lesion``, and the measures.

        ``network`` is "trained", or, in the first rows, "fresh" for the control.
        """
        return self._table

    def _init_callback(self) -> None:
        policy = self.model.policy
        lesions = policy.motor_network.available_lesions() if isinstance(policy, MotorPolicy) else ()
        if not lesions:
            raise UserError("A lesion probe needs a policy with two hemispheres, such as CallosalPolicy.")
        self._states = (INTACT, *lesions)

    def _on_training_start(self) -> None:
        super()._on_training_start()
        self._table = self._past()
        if not self._is(TRAINED).any():
            self._schedule = Schedule(self._every, self.num_timesteps, at_once=True)
        if not self._is(FRESH).any():
            self._table = pd.concat([self._control(), *([self._table] if len(self._table) else [])], ignore_index=True)
        self._show_charts()

    def _on_training_end(self) -> None:
        if self._table.loc[self._is(TRAINED), "timesteps"].max() != self.num_timesteps:
            self.act()
        if self._path is not None:
            self._draw(self._path.with_name(FIGURE))

    def act(self) -> None:
        """Test every state now."""
        records = self._tested()
        rows = self._rows(records, TRAINED, self.num_timesteps)
        self._table = pd.concat([self._table, rows], ignore_index=True)
        self._write()
        self._log(rows.set_index("lesion"), [self._metric.value(records[lesion]) for lesion in ALONE.values()])

    def _tested(self) -> dict[str, TrialRecord]:
        """The trials of every state of the policy as it is."""
        records: dict[str, TrialRecord] = {}
        for state in self._states:
            with self._policy.motor_network.lesioned(state):
                records[state] = self._evaluator.run(self._policy)
        return records

    def _rows(self, records: Mapping[str, TrialRecord], network: str, timesteps: int) -> pd.DataFrame:
        measures = {state: self._measured(record) for state, record in records.items()}
        rows = pd.DataFrame.from_dict(measures, orient="index").rename_axis("lesion").reset_index()
        rows = rows.assign(network=network, timesteps=timesteps)
        return rows[[*COLUMNS, *(name for name in rows if name not in COLUMNS)]]

    def _measured(self, record: TrialRecord) -> dict[str, float]:
        """The measures of trials, of two arms also by hand and role."""
        summary = record.summary(self._threshold)
        return {name: summary[name] for name in MEASURES} | record.numbers_by_hand(self._threshold)

    def _control(self) -> pd.DataFrame:
        """The rows of a fresh network, which takes the place of the policy's for as long as it is tested."""
        network = self._policy.motor_network
        present = {name: tensor.detach().clone() for name, tensor in network.state_dict().items()}
        network.load_state_dict(fresh_copy(network, self.model.seed or 0))
        try:
            return self._rows(self._tested(), FRESH, 0)
        finally:
            network.load_state_dict(present)

    def _measures(self) -> list[str]:
        """The names of the measures in the table."""
        return [str(name) for name in self._table if name in MEASURES or name in OF_HANDS]

    def _is(self, network: str) -> pd.Series:
        """Which rows of the table are of these networks."""
        return self._table["network"] == network

    @property
    def _policy(self) -> MotorPolicy:
        policy = self.model.policy
        assert isinstance(policy, MotorPolicy)
        return policy

    def _past(self) -> pd.DataFrame:
        """Return the rows of the steps so far; those after a saved state are made again."""
        if not self.num_timesteps:
            return pd.DataFrame(columns=list(COLUMNS))
        table = self._table
        if self._path is not None and self._path.exists():
            try:
                table = read_probe(self._path)
            except UserError as error:
                raise UserError(f"{error} Move it away to go on without it.") from None
        return table if table.empty else table[table["timesteps"] <= self.num_timesteps]

    def _write(self) -> None:
        if self._path is not None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with replacing(self._path) as temporary:
                self._table.to_csv(temporary, index=False, float_format="%.6g")

    def _log(self, rows: pd.DataFrame, alone: list[float]) -> None:
        for state in self._states:
            for name in self._measures():
                self.logger.record(f"lesions_{name}/{state}", rows.loc[state, name], exclude="stdout")
        index = f"specialization/{self._metric.name}"
        if self._is_at_floor(rows):
            self.logger.record(index, AT_FLOOR, exclude=("tensorboard", "csv"))
        else:
            self.logger.record(index, float(specialization_index(*alone)))
        self.logger.dump(self.num_timesteps)

    def _is_at_floor(self, rows: pd.DataFrame) -> bool:
        """Whether neither side alone does better than the control's."""
        measure = _JUDGED[self._task.judged_by]
        now, fresh = rows[measure], self._table[self._is(FRESH)].set_index("lesion")[measure]
        return all(is_above(now[[side]], fresh[[side]], now[[INTACT]]) is False for side in ALONE.values())

    def _show_charts(self) -> None:
        """Have tensorboard's custom scalars show the states of each measure in one chart."""
        names = self._measures()
        charts = {name: ["Multiline", [f"lesions_{name}/{state}$" for state in self._states]] for name in names}
        for output in self.logger.output_formats:
            if isinstance(output, TensorBoardOutputFormat) and output.writer is not None:
                output.writer.add_custom_scalars({"lesions": charts})

    def _draw(self, path: Path) -> None:
        # Only needed here, and slow to import.
        from bilateral_rl.figures.saving import save
        from bilateral_rl.figures.specialization_over_training import specialization_over_training

        model = self._name or self._policy.motor_network.architecture
        figure = specialization_over_training(self._table.assign(model=model, seed=0), self._task)
        try:
            save(figure, path)
        except UserError as error:  # no reason to lose the end of a training
            warnings.warn(str(error), stacklevel=2)
        self.logger.record(f"figures/{FIGURE}", LoggedFigure(figure, close=True), exclude=("stdout", "csv"))
        self.logger.dump(self.num_timesteps)


def probe_of_run(config: RLConfig, folder: RunFolder) -> LesionProbe | None:
    """Build the probe that a run's configuration asks for; None if it asks for none, or if there are no hemispheres."""
    evaluation = config.evaluation
    if not evaluation.lesion_probe_every or config.spec.architecture == "unilateral":
        return None
    return LesionProbe(
        config.make_task(),
        config.trial,
        every=evaluation.lesion_probe_every,
        folder=folder.path,
        trials=evaluation.trials,
        seed=evaluation.seed,
        device=config.device,
        name=config.model,
    )
