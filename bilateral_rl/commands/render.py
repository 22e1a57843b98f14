"""`bilateral-rl render`."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from bilateral_rl.api.rendering import make_video
from bilateral_rl.config.parse import parse_overrides


def render(
    *,
    runs: Sequence[str],
    out: Path | None,
    trials: int,
    seed: int,
    lesion: str,
    weights: str,
    slow_down: int,
    size: int,
    task: str | None,
    overrides: Sequence[str],
    console: Console,
) -> Path:
    """Write a video of networks that do the same trials, those that ``evaluate`` tests with the same seed.

    Args:
        runs: each RUN or RUN:SEED; of several seeds the first is shown if none is named.
        out: an .mp4 or .gif; None for one beside the first run's folder. An earlier video of this command is replaced,
            and nothing else.
        trials: number of trials, one after another.
        seed: seed of the first trial; trial i is the first one of ``seed + i``.
        lesion: "intact" or a lesion of the paper (section 6), for every network.
        weights: which of each run's weights.
        slow_down: seconds of video for a second of the arm's time.
        size: height of each network's picture (pixels, even), and its width where there is one arm.
        task: another task than the runs', which may then have learned different ones.
        overrides: other settings of trials, ``["trial.sensory_noise=0.01"]``.
        console: where to print.

    Returns:
        The path of the video.

    Raises:
        UserError: runs that cannot be shown, or not together, or a file that cannot be written; none is left then.
    """
    settings = parse_overrides(overrides, "trial.sensory_noise=0.01")
    video = make_video(runs, out, trials, seed, lesion, weights, slow_down, size, task, settings, console)
    for note in video.notes:
        console.print(f"[yellow]Note:[/yellow] {escape(note)}", soft_wrap=True, highlight=False)
    quoted = escape(shlex.quote(str(video.path)))
    console.print(f"Saved {video.seconds:.0f} s of video in [bold]{quoted}[/bold].", soft_wrap=True)
    return video.path
