"""Progress bars on a terminal and in a notebook; where there is neither, nothing is drawn."""

from __future__ import annotations

import importlib
import io
import time
from typing import Any

from rich.console import Console, RenderableType
from rich.live import Live
from rich.progress import Progress, ProgressColumn, TaskID

_INTERVAL = 0.25
"""Seconds between two pictures in a notebook: each is a message to the browser."""
_HTML = "<pre style=\"font-family:Menlo,'DejaVu Sans Mono',consolas,monospace;margin:0\">{code}</pre>"


def draws(console: Console) -> bool:
    """Whether bars can be drawn on ``console``: it is a terminal, or a notebook."""
    return console.is_jupyter or (console.is_terminal and not console.is_dumb_terminal)


class Bars(Progress):
    """rich's bars, which in a notebook stand in the cell's output and need no widgets.

    Args:
        columns: of each bar.
        console: where to draw.
        transient: whether nothing is left of them at the end.
    """

    def __init__(self, *columns: str | ProgressColumn, console: Console, transient: bool = False) -> None:
        in_notebook = console.is_jupyter
        super().__init__(
            *columns,
            console=console,
            transient=transient,
            refresh_per_second=4,
            auto_refresh=not in_notebook,
            disable=not draws(console),
        )
        if in_notebook:
            self.live = _CellOutput(console=console, transient=transient, get_renderable=self.get_renderable)

    def update(self, task_id: TaskID, **changes: Any) -> None:  # type: ignore[override]
        super().update(task_id, **changes)
        self._show()

    def advance(self, task_id: TaskID, advance: float = 1) -> None:
        super().advance(task_id, advance)
        self._show()

    def _show(self) -> None:
        """Draw, in a notebook; on a terminal a thread does."""
        if isinstance(self.live, _CellOutput):
            self.refresh()


class _CellOutput(Live):
    """One output of a notebook's cell that is replaced again and again; it stays in the notebook that is saved."""

    _handle: Any = None
    _drawn_at = 0.0

    def start(self, refresh: bool = False) -> None:
        self._started = True
        self._draw(self.get_renderable())

    def stop(self) -> None:
        if self._started:
            self._started = False
            self._draw("" if self.transient else self.get_renderable())

    def refresh(self) -> None:
        if self._started and time.monotonic() - self._drawn_at >= _INTERVAL:
            self._draw(self.get_renderable())

    def _draw(self, renderable: RenderableType) -> None:
        self._drawn_at = time.monotonic()
        picture = _picture(renderable, self.console.width)
        if self._handle is None:
            display = importlib.import_module("IPython.display").display
            self._handle = display(picture, raw=True, display_id=True)
        else:
            self._handle.update(picture, raw=True)


def _picture(renderable: RenderableType, width: int) -> dict[str, str]:
    """Draw as HTML, and as text for those who cannot show it, by MIME type."""
    if renderable == "":
        return {"text/html": "", "text/plain": ""}
    page = Console(
        file=io.StringIO(), record=True, width=width, force_terminal=True, force_jupyter=False,
        color_system="truecolor",
    )  # fmt: skip
    page.print(renderable)
    html = page.export_html(inline_styles=True, code_format=_HTML, clear=False)
    return {"text/html": html, "text/plain": page.export_text().rstrip()}
