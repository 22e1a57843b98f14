"""An experiment that has every feature at once, and settings for its trials."""

from pathlib import Path

from bilateral_rl.envs import TrialSettings
from bilateral_rl.envs.experiments.files import experiment_from_file
from bilateral_rl.envs.experiments.task import ExperimentTask

EVERYTHING = Path(__file__).with_suffix(".yaml")


def everything() -> ExperimentTask:
    """Return the task."""
    return ExperimentTask(experiment_from_file(EVERYTHING))


SETTINGS = TrialSettings(trial_length=24, threshold=0.02)
