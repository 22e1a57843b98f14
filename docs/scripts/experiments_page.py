"""Write docs/reference/experiments.md, every field of an experiment's file, from the schema itself.

Run it after a change of the schema: ``python docs/scripts/experiments_page.py``. A test compares the page with it.
"""

from __future__ import annotations

import dataclasses
import types
import typing
from pathlib import Path
from typing import Annotated, Any

from pydantic import Discriminator, Tag, TypeAdapter
from settings_page import bounds, description, plain, text, unit

from bilateral_rl.envs.experiments import assignment, experiment, forces, numbers, places
from bilateral_rl.envs.experiments.files import SUFFIXES
from bilateral_rl.io.yaml_files import LARGEST_SETTINGS

PAGE = Path(__file__).parents[1] / "reference" / "experiments.md"

SECTIONS: dict[type, str] = {
    experiment.Experiment: "The experiment",
    experiment.Arms: "Two arms",
    assignment.Assignment: "What one arm does",
    places.Place: "A place",
    places.Region: "A region",
    places.CenterOut: "Targets on a circle",
    assignment.Cues: "The timeline",
    assignment.TargetJump: "A jump of the target",
    forces.Forces: "Forces",
    forces.ElasticField: "An elastic field",
    forces.ForcePulse: "A pulse",
    forces.Directions: "Pulses in several directions",
    forces.ForceChannel: "A channel",
}
FORMS = {
    numbers.Steps: "a whole number, or `[first, last]`",
    numbers.Point: "`[a, b]`",
    numbers.Points: "`[a, b]`, or a list of such",
    numbers.Grid: "`[n, m]`",
    numbers.Matrix: "`[[a, b], [c, d]]`",
    numbers.Stiffness: "a number, or `[[a, b], [c, d]]`",
}
"""What people write, of the kinds that have short forms."""

HEAD = f"""# Every field of an experiment

<!-- made by docs/scripts/experiments_page.py from the schema: change that, and run it again -->

An experiment is a YAML file of at most {LARGEST_SETTINGS // 1024} kB that ends in `{"` or `".join(SUFFIXES)}`, with
these fields; those without a default have to be there. How they go together is told on
[the page on experiments](../experiments.md). A run keeps all of them in its `config.yaml` under `experiment`, and
`--set experiment.forces.curl=8` changes one. In Python, an `Experiment` takes them as arguments:
`Experiment(name="mine", start={{"hand": [0, 0.4]}}, target="start")`.

Something else than these, a number out of its bounds, a position that the arm cannot reach, a step beyond the end of
the trial and forces under which the arm would swing are refused in one sentence, which names the file, the line and
the field.
"""


def page() -> str:
    """Return the whole page."""
    return "\n".join([HEAD, *(f"## {title}\n\n{table(cls)}" for cls, title in SECTIONS.items())])


def table(cls: type) -> str:
    """Return the rows of a dataclass's fields."""
    hints = typing.get_type_hints(cls, include_extras=True)
    lines = ["| field | takes | default | unit | what it is |", "|---|---|---|---|---|"]
    for field in dataclasses.fields(cls):
        words = description(cls, field.name)
        cells = (f"`{field.name}`", takes(hints[field.name]), default(field), unit(words), plain(words))
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def takes(hint: Any) -> str:
    """Say in words what a field takes; that null stands for a default goes without saying."""
    if typing.get_origin(hint) is Annotated:
        kind, *about = typing.get_args(hint)
        about = [one for one in about if not isinstance(one, (Tag, Discriminator))]
        hint = Annotated[kind, *about] if about else kind
    arguments = typing.get_args(hint)
    if words := next((words for form, words in FORMS.items() if hint == form), None):
        return words
    if hint in SECTIONS:
        title = SECTIONS[hint]
        return f"[{title[0].lower()}{title[1:]}](#{title.lower().replace(' ', '-')})"
    if isinstance(hint, types.UnionType) or typing.get_origin(hint) is typing.Union:
        return ", or ".join(takes(one) for one in arguments if one is not types.NoneType)
    if typing.get_origin(hint) is typing.Literal:
        return ", ".join(f"`{choice}`" for choice in arguments)
    if typing.get_origin(hint) is dict:
        return "[settings of trials](settings.md#trials) by name"
    return bounds(TypeAdapter(hint).json_schema())


def default(field: dataclasses.Field[Any]) -> str:
    """Return the default as YAML has it; a dash where there is none."""
    if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
        return "–"
    if field.default_factory is not dataclasses.MISSING:
        return "none"
    value = field.default
    if isinstance(value, tuple):  # steps, of which people write one
        return text(value[0])
    return "none" if value == "" else text(value)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
