"""The commands that the page on the zoo shows."""

import re
from pathlib import Path

import pytest

pytest.importorskip("rl_zoo3")

PAGE = Path(__file__).parents[3] / "docs" / "zoo.md"
LINE = re.compile(r"^python -m bilateral_rl\.zoo (.*)$", re.MULTILINE)
SHORT = {
    "enjoy": "-n 100 --no-render",
    "--optimize": "-n 200 --n-trials 1 --n-evaluations 1 --no-optim-plots -params n_envs:4 learning_starts:100",
    "plot": "",
    "record_video": "-n 20",
    "train": "-n 200 --eval-freq -1",
}
"""What makes a command short, by the first of these words that it has."""


@pytest.mark.filterwarnings("ignore:FigureCanvasAgg is non-interactive")
def test_the_commands_run(zoo, tmp_path):
    commands = LINE.findall(PAGE.read_text(encoding="utf-8").replace("\\\n", " "))
    assert {"train", "enjoy"} <= {command.split()[0] for command in commands}
    for command in commands:
        zoo(f"{command} {next(short for word, short in SHORT.items() if word in command)}")
    assert (tmp_path / "logs" / "hemispheric_ppo").is_dir()
