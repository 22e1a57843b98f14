"""What each side of a study's networks supplies to the muscle commands, in numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from bilateral_rl.analysis.formats import mean_sd
from bilateral_rl.analysis.modulation import SILENT_PERCENT, SideModulation, side_modulation
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.figures.labels import model_label, task_label
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import load_policies
from bilateral_rl.study.report_table import ReportTable
from bilateral_rl.vocabulary import SIDES, TEST_SEED

_TRIALS = 128
_NOTE = (
    "Share: a side's part of both sides' modulation, which is the standard deviation of what it adds to the commands "
    "before the sigmoid, over time and trials and as a mean over the muscles. Constant part: the absolute value of its "
    f"mean. A side is silent if its share is at most {SILENT_PERCENT:g} %."
)


def sides_tables(runs: Mapping[str, Mapping[str, Sequence[RunFolder]]]) -> Iterator[ReportTable]:
    """Make the table of what each side supplies, mean ± standard deviation over the seeds; none without two sides.

    Args:
        runs: the runs that are done, by task and model.
    """
    rows = [
        [f"{task_label(task)}, {model_label(model)}{arm}", *_cells(sides)]
        for task, of_task in runs.items()
        for model, of_model in of_task.items()
        for arm, sides in _by_arm([side for run in of_model for side in _sides(run)]).items()
    ]
    names = [side.replace("_", "-") for side in SIDES]
    columns = ["", *(f"{quantity}, {name}" for name in names for quantity in ("share (%)", "constant part"))]
    if rows:
        title = "What each side supplies"
        yield ReportTable("sides", title, [*columns, *(f"silent, {name}" for name in names)], rows, _NOTE)


def _by_arm(sides: Sequence[SideModulation]) -> dict[str, list[SideModulation]]:
    """What sides supply to each arm, by the end of its row's name; nothing where there are no sides."""
    if not sides:
        return {}
    if sides[0].n_arms == 1:
        return {"": list(sides)}
    return {f", {name.replace('_', '-')} arm": [side.of_arm(arm) for side in sides] for arm, name in enumerate(SIDES)}


def _cells(sides: Sequence[SideModulation]) -> list[str]:
    cells = []
    for side in SIDES:
        cells += [mean_sd([one.percent[side] for one in sides], 1), mean_sd([one.constant[side] for one in sides], 2)]
    return [*cells, *(f"{sum(side in one.silent for one in sides)} of {len(sides)}" for side in SIDES)]


def _sides(run: RunFolder) -> list[SideModulation]:
    """What the sides of each network of a run supply; empty if it has none."""
    config = run.config()
    if config.spec.architecture == "unilateral":
        return []
    evaluator = Evaluator(config.make_task(), config.trial, _TRIALS, TEST_SEED)
    of_networks = (side_modulation(p.motor_network, evaluator.run(p)) for p in load_policies(run).values())
    return [sides for sides in of_networks if sides]
