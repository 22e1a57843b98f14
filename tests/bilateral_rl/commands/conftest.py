import shutil
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from bilateral_rl.commands import app as cli
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.study import grid, sweep


@pytest.fixture
def toy_models(monkeypatch):
    """Trainings take the results that lie in ``prepared``, beside the study's folder, and fail where there are none."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "study"))
    for module in (grid, sweep):
        monkeypatch.setattr(module, "TRAIN_AND_MEASURE", "toy_models:measure")


@pytest.fixture
def invoke(tmp_path, monkeypatch):
    """Calls ``bilateral-rl`` in an empty folder; its exit code and what it printed. Errors are raised."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cli, "console", Console(width=200))

    def run(*arguments):
        result = CliRunner().invoke(cli.app, [str(argument) for argument in arguments])
        if isinstance(result.exception, UserError):
            raise UserError(result.exception.on_command_line)
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return result.exit_code, result.output

    return run


@pytest.fixture
def trained(_trained_bptt, tmp_path):
    """A finished run of three seeds at runs/random_reach/cc_s-bptt-1."""
    path = tmp_path / "runs" / "random_reach" / "cc_s-bptt-1"
    shutil.copytree(_trained_bptt.path, path)
    return RunFolder(path)
