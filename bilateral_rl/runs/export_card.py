"""The model card of an exported run: Markdown for people, headed by YAML that a hub of models indexes."""

from __future__ import annotations

import dataclasses
import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from bilateral_rl.config.catalogue import ALGORITHMS
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.envs.doors import arguments_for
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.task_specs import EXPERIMENT_ID, TASK_SPECS
from bilateral_rl.io.text import seed_range

_DIGITS = 3
"""Digits of a measure: more would be those of the trials drawn."""
_WIDTH = 100
"""Width of the text (characters)."""


@dataclass(frozen=True)
class Measured:
    """What the networks of a run came to in one measure."""

    name: str
    """Name, such as "goal_completion_5cm"."""
    label: str
    """The same in words."""
    unit: str
    """Empty for a pure number."""
    values: Sequence[float]
    """The mean over the trials of each network; NaN where it has none."""

    @property
    def mean(self) -> float:
        """Mean over the networks that have a value; NaN if none has."""
        numbers = [value for value in self.values if math.isfinite(value)]
        return sum(numbers) / len(numbers) if numbers else math.nan


_TAGS = {"reinforcement-learning": ["deep-reinforcement-learning", "stable-baselines3"], "robotics": []}
"""What people look for, by the kind of task."""


def model_card(config: TrainConfig, measures: Sequence[Measured], reward: tuple[float, float], tests: str) -> str:
    """Return the text of a model card.

    Args:
        config: the exported configuration.
        measures: what was measured.
        reward: mean and standard deviation of the return, the mean of both rewards, over all trials.
        tests: the trials, in words that begin a sentence.
    """
    head = yaml.safe_dump(_metadata(config, measures, reward), sort_keys=False, allow_unicode=True, width=1000)
    return f"---\n{head}---\n\n{_text(config, measures, tests)}"


def _metadata(config: TrainConfig, measures: Sequence[Measured], reward: tuple[float, float]) -> dict[str, Any]:
    kind = "robotics" if config.algo == "bptt" else "reinforcement-learning"
    environment = _environment(config)
    metrics = [
        {"type": measure.name, "value": _rounded(measure.mean), "name": _with_unit(measure), "verified": False}
        for measure in measures
        if math.isfinite(measure.mean)
    ]
    mean, deviation = reward
    total = {"type": "mean_reward", "value": f"{mean:.2f} +/- {deviation:.2f}", "name": "mean_reward"}
    result = {
        "task": {"type": kind, "name": kind},
        "dataset": {"name": environment, "type": environment},
        "metrics": [total | {"verified": False}, *metrics],
    }
    return {
        "library_name": "bilateral-rl",
        "pipeline_tag": kind,
        "tags": ["motor-control", *_TAGS[kind], environment, config.model, config.algo, config.spec.architecture],
        "model-index": [{"name": _name(config), "results": [result]}],
    }


def _text(config: TrainConfig, measures: Sequence[Measured], tests: str) -> str:
    seeds = config.all_seeds
    several = len(seeds) > 1
    who = f"{len(seeds)} networks ({seed_range(seeds)}) that move" if several else "A network that moves"
    arms = "a planar arm of two joints and six muscles"
    if config.n_arms == 2:
        arms = "two planar arms, each of two joints and six muscles"
    about = (
        f"{who} {arms}, to "
        f"{config.make_task().description or config.task_folder}. The model is "
        f"`{config.model}`, {config.spec.description}, trained by `{config.algo}`, {ALGORITHMS[config.algo]}."
    )
    if noise := config.network.hidden_noise:
        about += f" Its hidden units are noisy (standard deviation {noise:g}), so that no two of its actions are alike."
    measured = f"{tests}{'; of the networks the mean, and from lowest to highest' if several else ''}:"
    rows = [f"| {measure.label} | {_in_words(measure)} |" for measure in measures]
    learning = "epochs.csv" if config.algo == "bptt" else "evaluations.csv"
    policy = f"run.policy(seed={seeds[0]})" if several else "run.policy()"
    task, imported = _task_argument(config)
    arguments = ", ".join(["8", task, "seed=0", *_trial_arguments(config)])
    return f"""# {_name(config)}

{textwrap.fill(about, _WIDTH)}

## What it does

{textwrap.fill(measured, _WIDTH, break_on_hyphens=False)}

| measure | value |
|---|---|
{chr(10).join(rows)}

## Load it

With this folder at hand, and the toolkit bilateral-rl installed:

```python
import bilateral_rl as brl
{imported}
run = brl.load("FOLDER")  # where this page lies
policy = {policy}  # of stable-baselines3
env = brl.envs.ArmVecEnv({arguments})
action, _ = policy.predict(env.reset(), deterministic=True)
```

The same folder goes into every command in place of a run: `bilateral-rl evaluate FOLDER`, `bilateral-rl lesion FOLDER`,
`bilateral-rl render FOLDER`. Nothing in it is executed when it is read: there are no pickles.

| file | what it holds |
|---|---|
| `config.yaml` | every setting of the network, the arm, the trials and the training |
| `weights/final.safetensors` | the weights |
| `{learning}` | how it learned, where that is known |
| `status.json` | how far the training came, and which run and weights these are |
| `versions.json` | versions of the packages that trained it, and the machine |
"""


def _task_argument(config: TrainConfig) -> tuple[str, str]:
    """Return the task as an argument of an environment, and a line that imports it, empty if there is none."""
    if config.experiment is not None:
        return "run.config.experiment", ""
    module, _, name = config.task.partition(":")
    return (f"{name}()", f"from {module} import {name}\n") if name else (f'"{config.task}"', "")


def _environment(config: TrainConfig) -> str:
    """Return the name in Gymnasium of what the network learned; of a user's own class, that of the class."""
    if config.task in TASK_SPECS:
        return TASK_SPECS[config.task].environment_id
    return config.task if config.experiment is None else EXPERIMENT_ID


def _name(config: TrainConfig) -> str:
    return f"{config.model} {config.task} {config.algo}"


def _with_unit(measure: Measured) -> str:
    return f"{measure.label} ({measure.unit})" if measure.unit else measure.label


def _in_words(measure: Measured) -> str:
    numbers = [value for value in measure.values if math.isfinite(value)]
    if not numbers:
        return "–"
    unit = f" {measure.unit}" if measure.unit else ""
    spread = f" ({_rounded(min(numbers)):g} to {_rounded(max(numbers)):g})" if len(measure.values) > 1 else ""
    return f"{_rounded(measure.mean):g}{unit}{spread}"


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


def _trial_arguments(config: TrainConfig) -> list[str]:
    """Return the settings of trials that are not the usual ones, as arguments of an environment."""
    task = config.make_task()
    changed = _changed(dataclasses.asdict(config.trial), dataclasses.asdict(TrialSettings(**task.trial)))
    arguments = arguments_for(task, config.trial)
    return [f"{name}={value!r}" for name, value in changed.items() if name in arguments]


def _changed(values: Mapping[str, Any], usual: Mapping[str, Any]) -> dict[str, Any]:
    changed = {name: value for name, value in values.items() if value != usual[name]}
    return {
        name: _changed(value, usual[name]) if isinstance(value, Mapping) else value for name, value in changed.items()
    }
