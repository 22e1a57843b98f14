"""Scripts that no test runs, since they take minutes: at least all that they import is there."""

import ast
import importlib
from pathlib import Path

SCRIPTS = sorted((Path(__file__).parents[1] / "benchmarks").glob("*.py"))


def imported(source):
    """Module and name of every ``from bilateral_rl… import …``, also of scripts that a script holds as text."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("bilateral_rl"):
            yield from ((node.module, alias.name) for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and "\nfrom bilateral_rl" in node.value:
            yield from imported(node.value)


def test_what_they_import_is_there():
    for script in SCRIPTS:
        for module, name in imported(script.read_text(encoding="utf-8")):
            assert hasattr(importlib.import_module(module), name), f"{script.stem}: {module} has no {name}"
