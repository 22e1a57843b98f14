"""Draw public functions at random, to test whether a reader can guess which room each of them lives in.

    python benchmarks/guess_test.py CHECKOUT --seed 11 --questions questions.txt --truth truth.txt

The questions hold the name and the first line of the docstring, the truth the file as well. With ``--now`` the truth
also says in which file of a second checkout a function of the same name lives, which is where the guess should lead
after a move.
"""

from __future__ import annotations

import argparse
import ast
import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

FOLDERS = ("bilateral_rl", "envs", "policies")


@dataclass(frozen=True)
class Idea:
    """A public function at the top level of a module."""

    name: str
    summary: str
    file: str


def ideas(checkout: Path) -> Iterator[Idea]:
    """Yield every public, documented function of the checkout, file by file."""
    for folder in FOLDERS:
        for path in sorted((checkout / folder).rglob("*.py")):
            if any(parent.is_symlink() for parent in path.parents):
                continue  # bilateral_rl/envs and bilateral_rl/policies link to the two top-level folders
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                summary = ast.get_docstring(node) if isinstance(node, ast.FunctionDef) else None
                if isinstance(node, ast.FunctionDef) and summary and not node.name.startswith("_"):
                    yield Idea(node.name, summary.splitlines()[0], path.relative_to(checkout).as_posix())


def main() -> None:
    """Draw, and write the two files."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkout", type=Path)
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--now", type=Path, help="a second checkout, after a move")
    parser.add_argument("--questions", type=Path, default=Path("guess_questions.txt"))
    parser.add_argument("--truth", type=Path, default=Path("guess_truth.txt"))
    arguments = parser.parse_args()

    everything = list(ideas(arguments.checkout))
    drawn = random.Random(arguments.seed).sample(everything, arguments.count)
    now: dict[str, list[str]] = {}
    for idea in ideas(arguments.now) if arguments.now else ():
        now.setdefault(idea.name, []).append(idea.file)

    head = f"{len(drawn)} of {len(everything)} public functions, drawn with seed {arguments.seed}"
    questions = [f"{number:2}. {idea.name}: {idea.summary}" for number, idea in enumerate(drawn, start=1)]
    truth = [
        f"{number:2}. {idea.name}: {idea.file}"
        + (f" → {' or '.join(now.get(idea.name, ['no function of this name']))}" if arguments.now else "")
        for number, idea in enumerate(drawn, start=1)
    ]
    arguments.questions.write_text("\n".join([head, *questions, ""]), encoding="utf-8")
    arguments.truth.write_text("\n".join([head, *truth, ""]), encoding="utf-8")


if __name__ == "__main__":
    main()
