"""The figure of an adaptation by blocks, in the folder of its run."""

from __future__ import annotations

import warnings

from bilateral_rl.analysis.block_table import BLOCKS, read_blocks
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder

FIGURE = "adaptation"
"""Name of its files, without suffix."""


def draw_adaptation(folder: RunFolder) -> None:
    """Draw the blocks of a run, if it has any; where that cannot be written, a warning says so."""
    if not (folder.path / BLOCKS).exists():
        return
    # Only needed here, and slow to import.
    from bilateral_rl.figures.adaptation import adaptation
    from bilateral_rl.figures.labels import model_label, task_label
    from bilateral_rl.figures.saving import save

    config = folder.config()
    try:
        title = f"{task_label(config.task)}: {model_label(config.model)}, block by block"
        save(adaptation(read_blocks(folder.path / BLOCKS), title), folder.path / FIGURE)
    except UserError as error:  # no reason to lose the end of a training
        warnings.warn(str(error), stacklevel=2)
