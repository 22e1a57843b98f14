"""Figures as files, the same figure with the same bytes, and as arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import replacing

DPI = 220
"""Dots an inch: the common width has 1,320 pixels."""

_PNG_METADATA = {"Software": None}
_PDF_METADATA = {"Creator": None, "Producer": None, "CreationDate": None}
"""Entries without which matplotlib would write versions and times into the files."""


def save(figure: Figure, path: Path) -> tuple[Path, Path]:
    """Write ``figure`` as ``path`` + ``.png`` and ``path`` + ``.pdf``, both or, if either cannot be drawn, neither.

    Returns:
        The two files.

    Raises:
        UserError: the folder cannot be written.
    """
    png, pdf = (path.with_name(path.name + suffix) for suffix in (".png", ".pdf"))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(png) as new_png, replacing(pdf) as new_pdf:
            figure.savefig(new_png, format="png", dpi=DPI, metadata=_PNG_METADATA)
            figure.savefig(new_pdf, format="pdf", metadata=_PDF_METADATA)
    except OSError as error:
        raise UserError(f"Cannot write the figure {path}: {error.strerror}. Choose another folder.") from None
    return png, pdf


def as_array(figure: Figure) -> np.ndarray:
    """Return ``figure`` as an RGB picture, (height, width, 3) from 0 to 255."""
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()
