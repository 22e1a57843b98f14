"""The folder of a run's lesion results: a long table, what it is of, figures and events for tensorboard."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from torch.utils.tensorboard import SummaryWriter

from bilateral_rl.analysis.metric import ROLES, Metric
from bilateral_rl.analysis.metrics import find_metric, preferred_metric
from bilateral_rl.analysis.results import FRESH, protocols_in, read_results
from bilateral_rl.config.parse import plain
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.figures.hands import spring_in_words
from bilateral_rl.figures.lesioned_hands import lesioned_hands
from bilateral_rl.figures.lesions import lesion_effects
from bilateral_rl.figures.saving import save
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import refuse_traps, replacing
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.study.folder import new_folder
from bilateral_rl.study.lesion_description import differences, lesion_command, up_to_date
from bilateral_rl.study.lesioning import LesionSettings
from bilateral_rl.study.provenance import describe_source, is_stale, source_path

RESULTS, SETTINGS = "lesions.csv", "settings.json"


@dataclass(frozen=True)
class LesionFolder:
    """``<run>-lesions/``: results beside the run, which itself is only read."""

    path: Path

    @classmethod
    def beside(cls, run: RunFolder, seed: int | None) -> LesionFolder:
        """The default folder of the results of ``run``, or of the one network of it that ``seed`` names."""
        path = run.path.resolve()
        return cls(path.with_name(f"{path.name}{'' if seed is None else f'-seed-{seed}'}-lesions"))

    def describe(self, run: RunFolder, settings: LesionSettings, seed: int | None, weights: str) -> dict[str, Any]:
        """Describe a study whose results are to lie here: the entries of ``settings.json``.

        Raises:
            UserError: weights that are missing or damaged.
        """
        networks = run.config().all_seeds if seed is None else [seed]
        description = describe_source(run, weights, self.path) | {"networks": networks} | dataclasses.asdict(settings)
        return dict(plain(description))

    @contextlib.contextmanager
    def claimed(self, run: RunFolder, description: Mapping[str, Any]) -> Iterator[None]:
        """A context in which the results of the study described can be written here; no new folder is left if it fails.

        Raises:
            UserError: other files could be harmed, the folder holds another study, or nothing can be written.
        """
        if self.path.resolve().is_relative_to(run.path.resolve()):
            raise UserError(f"{self.path} lies in the run, which stays as it is; choose another --out.")
        with contextlib.ExitStack() as stack:
            with self._refusing():
                stack.enter_context(new_folder(self.path))
                self._check_writable()
                self._check_same_study(run, description)
            yield

    def write(self, results: pd.DataFrame, description: Mapping[str, Any], config: TrainConfig) -> None:
        """Write the table, what it is of, the figures and the events, in the place of those of an earlier call.

        Raises:
            UserError: the folder cannot be written.
        """
        with self._refusing():
            with replacing(self.path / RESULTS) as temporary:
                results.to_csv(temporary, index=False)
            with replacing(self.path / SETTINGS) as temporary:
                temporary.write_text(json.dumps(description, indent=2) + "\n", encoding="utf-8")
            for pattern in ("events.out.tfevents.*", "lesions_*.png", "lesions_*.pdf"):
                for outdated in self.path.glob(pattern):
                    outdated.unlink()
            self._draw(results, config)
            self._write_events(results)

    def _draw(self, results: pd.DataFrame, config: TrainConfig) -> None:
        """Write the figures of each metric: both hands together and, of two arms, each by itself."""
        task, model, spring = config.task, config.model, config.trial.two_arms.spring.stiffness
        for metric in lesion_metrics(config):
            path = self.path / f"lesions_{metric.name}"
            save(lesion_effects(results, task, metric, [model], hands=_hands_in_words(metric, config)), path)
            if by_hand := lesioned_hands(results, task, metric, model, spring):
                save(by_hand, path.with_name(f"{path.name}_by_hand"))

    def _write_events(self, results: pd.DataFrame) -> None:
        """Write the mean over the seeds of each metric and lesion, a line for each protocol and for its control."""
        states = ["metric", "lesion", "network", "protocol", "epochs"]
        means = results.groupby(states, sort=False)["value"].mean().reset_index()
        retrained = [name for name in protocols_in(results) if name != "none"]
        with SummaryWriter(str(self.path)) as board:
            for row in means.to_dict("records"):
                # Along the x axis: epochs of retraining. Every line begins where nothing has been retrained yet.
                lines = (retrained or ["none"]) if row["protocol"] == "none" else [row["protocol"]]
                control = "/fresh" if row["network"] == FRESH else ""
                for line in lines:
                    tag = f"lesions_{row['metric']}/{row['lesion']}/{line}{control}"
                    board.add_scalar(tag, row["value"], row["epochs"])

    def holds_stale_results(self, run: RunFolder) -> bool:
        """Whether there are results here, and they say that they are of other weights than ``run`` has now."""
        return is_stale(self._description(), run) is True

    def read(self, run: RunFolder, name: str) -> tuple[pd.DataFrame, list[str]]:
        """Read the table of ``run``, and notes on it.

        Args:
            run: the run.
            name: RUN or RUN:SEED, as the commands take it.

        Raises:
            UserError: there is no table, it is damaged, or it is of weights that the run no longer has.
        """
        path = self.path / RESULTS
        if not path.is_file():
            raise UserError(f"One run is compared by its lesions: call `{lesion_command(name, {})}` first.")
        results, description = read_results(path), self._description()
        command = lesion_command(name, description)
        stale = is_stale(description, run)
        if stale:
            raise UserError(
                f"{path} holds lesions of weights that {run.path} no longer has, as after more training; call "
                f"`{command}` to make them anew."
            )
        notes = []
        if stale is None:
            notes.append(
                f"{path} does not say which weights it is of; if the run was trained on since, call `{command}`."
            )
        if isinstance(spring := description.get("spring"), int | float):
            notes.append(f"{path} is of tests with a spring of {spring:g} N/m between the hands.")
        return results, notes

    @contextlib.contextmanager
    def _refusing(self) -> Iterator[None]:
        """A context whose OSError is told as one that --out can help."""
        try:
            yield
        except OSError as error:
            raise UserError(f"Cannot write {self.path}: {error.strerror}. Choose another --out.") from None

    def _description(self) -> dict[str, Any]:
        description = RunFolder(self.path).read_json(SETTINGS, default={})
        return up_to_date(description) if isinstance(description, dict) else {}

    def _check_writable(self) -> None:
        refuse_traps(self.path)
        if any(self.path.iterdir()) and not (self.path / RESULTS).is_file():
            raise UserError(f"{self.path} holds other things than an earlier {RESULTS}; choose another --out.")
        with tempfile.TemporaryFile(dir=self.path):
            pass

    def _check_same_study(self, run: RunFolder, description: Mapping[str, Any]) -> None:
        stored = RunFolder(self.path).read_json(SETTINGS, default={})
        if not isinstance(stored, dict):
            raise UserError(f"{self.path / SETTINGS} does not say how lesions were made; choose another --out.")
        stored = up_to_date(stored)
        if differing := "; ".join(differences(stored, description)):
            raise UserError(
                f"{self.path} holds lesions made with other settings ({differing}); choose another --out, or remove it."
            )
        if stored and is_stale(stored, run) is not False and not self._is_of(run, stored):
            raise UserError(f"{self.path} holds the lesions of another run; choose another --out, or remove it.")

    def _is_of(self, run: RunFolder, stored: Mapping[str, Any]) -> bool:
        """Whether the results are of ``run``, whatever its weights were then, and wherever it was."""
        networks = run.config().all_seeds
        if self.path.resolve() in {LesionFolder.beside(run, seed).path for seed in (None, *networks)}:
            return True
        stored_path, path = source_path(stored, self.path), run.path.resolve()
        if stored_path is None or stored_path == path:
            return stored_path is not None
        return stored_path.name == path.name and not stored_path.exists()  # it was moved, and the path was absolute


def lesion_metrics(config: TrainConfig) -> Sequence[Metric]:
    """The metrics that are printed and drawn: the task's preferred one and the final error, of the same trials."""
    preferred, error = (
        find_metric(preferred_metric(config.make_task(), config.trial.threshold)),
        find_metric("final_error"),
    )
    return [preferred, error if preferred.condition is None else error.within(preferred.condition)]


def _hands_in_words(metric: Metric, config: TrainConfig) -> str:
    """Say that a value is the mean of both hands, in which role, and what ties them; "" of one arm."""
    if config.n_arms == 1:
        return ""
    roles = {metric.part.role} if metric.part.role else config.make_task().roles
    doing = " and ".join(f"where they {role}" for role in ROLES if role in roles)
    return f"Values are means of both hands, {doing}. {spring_in_words(config.trial.two_arms.spring.stiffness)}"
