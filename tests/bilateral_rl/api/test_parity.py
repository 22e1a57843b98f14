"""Nothing can be done by a command and not in Python, or the other way round: options are arguments."""

import inspect

import pytest
import typer

import bilateral_rl as brl
from bilateral_rl.api.wording import argument
from bilateral_rl.commands.app import app

OF_COMMANDS = {
    "train": brl.train,
    "evaluate": brl.Run.evaluate,
    "record": brl.Run.record_to,
    "export": brl.Run.export,
    "lesion": brl.Run.lesion,
    "compare": brl.compare,
    "render": brl.render,
    "reproduce": brl.reproduce,
    "sweep": brl.sweep,
    "import": brl.import_model,
    "list": brl.list_runs,
}
"""What does in Python what each command does."""
FILES = {"csv", "json"}
"""Options that write what is a DataFrame in Python."""
ONLY_COMMAND = {
    "train": {"resume()"},  # Run.resume
    "lesion": {"no_retrain"},  # retrain="none"
    "sweep": {"metrics"},  # which of the table's to print
}
ONLY_PYTHON = {"progress", "by", "run", "runs", "self"}
"""Arguments that a command has no option for, or that are its own."""


def options(name):
    """The arguments that a command's options are, by the names that errors give them in Python."""
    command = typer.main.get_group(app).commands[name]
    named = [param.opts[0] if param.opts[0].startswith("--") else param.name for param in command.params]
    found = {argument(option).split("=")[0] for option in named} - {"help"}
    return {"lesions" if (name, option) == ("lesion", "lesion") else option for option in found}


@pytest.mark.parametrize("name", OF_COMMANDS)
def test_options_are_arguments(name):
    known = set(inspect.signature(OF_COMMANDS[name]).parameters) - ONLY_PYTHON
    assert options(name) - ONLY_PYTHON - FILES - ONLY_COMMAND.get(name, set()) == known


def test_every_command_has_its_function():
    assert {*OF_COMMANDS} == {*typer.main.get_group(app).commands}
