"""Write docs/reference/settings.md, every setting of a configuration, from the configuration itself.

Run it after a change of a setting: ``python docs/scripts/settings_page.py``. A test compares the page with the code.
"""

from __future__ import annotations

import ast
import dataclasses
import functools
import inspect
import itertools
import re
import textwrap
import typing
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import TypeAdapter

from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import CONFIGS
from bilateral_rl.envs.task_specs import PARADIGMS, TASK_SPECS

PAGE = Path(__file__).parents[1] / "reference" / "settings.md"

NAMES = {"ppo": "PPO", "a2c": "A2C", "sac": "SAC", "td3": "TD3", "bptt": "BPTT"}
SECTIONS = {
    "": "The training as a whole",
    "network": "The network",
    "trial": "Trials",
    "trial.losses": "Losses and rewards",
    "trial.losses.dominant": "Weights of the dominant loss",
    "trial.losses.non_dominant": "Weights of the non-dominant loss",
    "trial.two_arms": "Trials of two arms",
    "trial.two_arms.spring": "The spring between the hands",
    "trial.arm": "The arm",
    "evaluation": "Evaluations along the way",
    "blocks": "Blocks of an adaptation",
    **NAMES,
}
UNITS = (
    "steps", "trials", "epochs", "updates", "m", "rad", "kg", "kg m²", "N", "s", "m/rad", "m/rad²", "nats",
    "optimal lengths", "optimal lengths/s", "1/s", "N/m", "N·s/m", "degrees",
)  # fmt: skip
"""What counts as a unit when it stands in parentheses in a description."""
_NAMED: dict[str, Iterable[str]] = {"algo": CONFIGS, "model": MODELS, "task": (*TASK_SPECS, *PARADIGMS)}
CHOICES = {name: ", ".join(f"`{choice}`" for choice in choices) for name, choices in _NAMED.items()}
CHOICES["task"] += ", a class"
CHOICES["experiment"] = "[an experiment](../experiments.md#what-a-file-can-say) or `null`"

HEAD = """# Every setting

<!-- made by docs/scripts/settings_page.py from the configuration: change that, and run it again -->

A run's `config.yaml` holds all of these, resolved. Change one with `--set`, or several with a file:

```sh
bilateral-rl train --task hold_position --set ppo.gamma=0.9 --set trial.max_load=5
bilateral-rl train --config mine.yaml
```

A setting with a dot belongs to a section of the file: `trial.max_load=5` is `max_load: 5` under `trial:`. Where the
default depends on the algorithm or on the task, the table names each; *reach* is `random_reach`, *hold* is
`hold_position`, and *one arm* and *two arms* are all tasks of so many. A dash in the column of units stands for a pure
number, a count or a word.

A value out of its bounds is refused before anything is computed, and so is a name that the algorithm does not know.
Bounds that concern several settings at once (a network that would not fit into memory, for example) are checked too.
How the tuned values were found is told on [the page on tuning](../tuning.md).
"""


class Setting(NamedTuple):
    """One setting of one algorithm's configuration."""

    description: str
    schema: Mapping[str, Any]


def page() -> str:
    """Return the whole page."""
    algos = {name: list(settings(name)) for name in CONFIGS}
    found = dict.fromkeys(itertools.chain.from_iterable([key for key, _ in pairs] for pairs in algos.values()))
    if left_out := {key for key in found if key.rpartition(".")[0] not in SECTIONS}:
        raise LookupError(f"SECTIONS needs a title for those of {', '.join(sorted(left_out))}.")
    parts = [HEAD]
    for section, title in SECTIONS.items():
        keys = [key for key in found if key.rpartition(".")[0] == section]
        parts.append(f"## {title}\n\n" + table(keys, {name: dict(pairs) for name, pairs in algos.items()}))
    return "\n".join(parts)


def table(keys: list[str], algos: Mapping[str, Mapping[str, Setting]]) -> str:
    """Return the rows of some settings."""
    lines = ["| setting | default | unit | bounds | what it is |", "|---|---|---|---|---|"]
    for key in keys:
        having = {algo: found[key] for algo, found in algos.items() if key in found}
        only = f" ({', '.join(NAMES[algo] for algo in having)})" if len(having) < len(algos) and "." not in key else ""
        cells = (
            f"`{key}`{only}",
            default(key, having),
            unit(next(iter(having.values())).description),
            CHOICES.get(key) or by_algorithm({algo: bounds(setting.schema) for algo, setting in having.items()}),
            by_algorithm({algo: plain(setting.description) for algo, setting in having.items()}),
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def settings(algo: str) -> Iterator[tuple[str, Setting]]:
    """Yield every setting of an algorithm with its dotted name."""
    whole = TypeAdapter(CONFIGS[algo]).json_schema()
    yield from _fields(CONFIGS[algo], whole, whole.get("$defs", {}), "")


def _fields(cls: type, schema: Mapping[str, Any], defs: Mapping[str, Any], path: str) -> Iterator[tuple[str, Setting]]:
    hints = typing.get_type_hints(cls)
    for field in dataclasses.fields(cls):
        inner = schema["properties"][field.name]
        kind = hints[field.name]
        if isinstance(kind, type) and dataclasses.is_dataclass(kind):
            yield from _fields(kind, defs[kind.__name__], defs, f"{path}{field.name}.")
        else:
            yield path + field.name, Setting(description(cls, field.name), inner)


def description(cls: type, name: str) -> str:
    """Return the sentence that stands below a field in the class, or in the nearest base class that has one."""
    texts = [text for base in cls.__mro__ if (text := _docstrings(base).get(name))]
    if not texts:
        raise LookupError(f"{cls.__name__}.{name} needs a docstring below it: what it is, and its unit in parentheses.")
    return texts[0]


@functools.cache
def _docstrings(cls: type) -> dict[str, str]:
    if not dataclasses.is_dataclass(cls):
        return {}
    (tree,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
    assert isinstance(tree, ast.ClassDef)
    return {
        statement.target.id: " ".join(following.value.value.split())
        for statement, following in itertools.pairwise(tree.body)
        if isinstance(statement, ast.AnnAssign)
        and isinstance(statement.target, ast.Name)
        and isinstance(following, ast.Expr)
        and isinstance(following.value, ast.Constant)
        and isinstance(following.value.value, str)
    }


def default(key: str, algos: Iterable[str]) -> str:
    """Return the default, or the defaults by algorithm and task."""
    return by_algorithm({algo: by_task({task: _value(algo, task, key) for task in TASK_SPECS}) for algo in algos})


def by_algorithm(texts: Mapping[str, str]) -> str:
    """Write a text once if it is the same for every algorithm that has it, else once for each that differs."""
    having: dict[str, list[str]] = {}
    for algo, words in texts.items():
        having.setdefault(words, []).append(NAMES[algo])
    if len(having) == 1:
        return next(iter(having))
    return "<br>".join(f"{', '.join(names)}: {words}" for words, names in having.items())


def by_task(texts: Mapping[str, str]) -> str:
    """Write a text once if it is the same for every task, else once for each kind of task for which it differs."""
    having: dict[str, list[str]] = {}
    for task, words in texts.items():
        having.setdefault(words, []).append(task)
    if len(having) == 1:
        return next(iter(having))
    return "; ".join(f"{_kind(tasks)} {words}" for words, tasks in having.items())


def _kind(tasks: list[str]) -> str:
    """Say which tasks these are: all of one arm, all of two, or their names."""
    words = []
    for n_arms, all_of_them in ((1, "one arm"), (2, "two arms")):
        of_these = [name for name, spec in TASK_SPECS.items() if spec.n_arms == n_arms]
        words += [all_of_them] if set(of_these) <= set(tasks) else [name for name in of_these if name in tasks]
    return ", ".join(words)


def _value(algo: str, task: str, key: str) -> str:
    value: Any = _resolved(algo, task)
    for part in key.split("."):
        value = value[part]
    return "(the task)" if key == "task" else "(the algorithm)" if key == "algo" else text(value)


@functools.cache
def _resolved(algo: str, task: str) -> dict[str, Any]:
    return resolve(algo, task).to_values()


def text(value: Any) -> str:
    """Write a value as YAML has it, rounded for people."""
    if isinstance(value, list):
        return f"[{', '.join(text(item) for item in value)}]"
    if isinstance(value, bool) or value is None:
        return {True: "true", False: "false", None: "null"}[value]
    if isinstance(value, int):
        return f"{value:,}"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def unit(sentence: str) -> str:
    """Return the unit that a description names in parentheses, or a dash."""
    return next((found for found in re.findall(r"\(([^()]*)\)", sentence) if found in UNITS), "–")


def bounds(schema: Mapping[str, Any]) -> str:
    """Say in words what values a field takes."""
    if "anyOf" in schema:
        return " or ".join(bounds(choice) for choice in schema["anyOf"])
    if "enum" in schema:
        return ", ".join(f"`{choice}`" for choice in schema["enum"])
    kind = schema.get("type")
    if kind == "array":
        inner = bounds(schema.get("items") or schema["prefixItems"][0])
        if "enum" in schema.get("items", ()):
            return f"a list of {inner}"
        fewest, most = schema.get("minItems", 0), schema["maxItems"]
        return f"{fewest if fewest == most else f'{fewest} to {most}'} numbers, each {inner}"
    if kind in ("number", "integer"):
        return f"{'whole, ' if kind == 'integer' else ''}{_range(schema)}"
    return {"boolean": "`true`, `false`", "null": "`null`", "string": "a word"}[str(kind)]


def _range(schema: Mapping[str, Any]) -> str:
    low = [schema[name] for name in ("ge", "minimum") if name in schema]
    above = [schema[name] for name in ("gt", "exclusiveMinimum") if name in schema]
    high = [schema[name] for name in ("le", "maximum") if name in schema]
    below = [schema[name] for name in ("lt", "exclusiveMaximum") if name in schema]
    signs = (("≥", low), (">", above), ("≤", high), ("<", below))
    ends = [f"{sign}\N{NO-BREAK SPACE}{_large(x)}" for sign, found in signs for x in found]
    return ", ".join(ends) or "any finite number"


def _large(value: float) -> str:
    return {10**15: "10¹⁵", 2**32 - 1: "2³² − 1"}.get(int(value), text(value))


def plain(sentence: str) -> str:
    """Return a docstring's sentence as Markdown, in a table that has the unit in a column of its own."""
    return sentence.replace(f" ({unit(sentence)})", "").replace("``", "`").replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
