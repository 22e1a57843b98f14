"""The map of the house: rooms, floors, and the imports between rooms.

``python tests/helpers/rooms.py`` prints it; ``tests/test_rooms.py`` holds it. A folder or a module beside
``__init__.py`` is a room. Imports are read from the source, also those inside functions and under ``TYPE_CHECKING``.
"""

from __future__ import annotations

import ast
import sys
from collections import Counter
from pathlib import Path

FLOORS: list[list[str]] = [
    ["vocabulary", "reward_pair", "io", "envs", "policies", "algorithms"],
    ["config"],
    ["runs", "analysis", "bptt"],
    ["figures", "claims", "video"],
    ["training"],
    ["study", "zoo"],
    ["api", "commands"],
]
"""From the ground up. A room may import rooms of floors below, and of its own floor those that stand before it."""

ALONE = {"envs": {"vocabulary", "reward_pair", "io"}, "policies": {"vocabulary"}}
"""What these rooms may import at most: they know nothing of each other or of the study."""


def imports(root: Path) -> Counter[tuple[str, str]]:
    """Return how many import statements of each room name another room."""
    found: Counter[tuple[str, str]] = Counter()
    for path in _sources(root):
        room = _room(path, root)
        for module in _imported(path):
            parts = module.split(".")
            if parts[0] == "bilateral_rl" and len(parts) > 1 and parts[1] != room:
                found[room, parts[1]] += 1
    return found


def rooms(root: Path) -> set[str]:
    """Return the names of all rooms that have source files."""
    return {_room(path, root) for path in _sources(root)} - {"__init__"}


def upward(found: Counter[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return the imports that lead up, or against the order of a floor."""
    place = {room: (number, floor.index(room)) for number, floor in enumerate(FLOORS) for room in floor}
    return sorted((a, b) for a, b in found if a != "__init__" and place[b] >= place[a])


def _sources(root: Path) -> list[Path]:
    folders = [root / "bilateral_rl", root / "envs", root / "policies"]
    return sorted(
        path
        for folder in folders
        for path in folder.rglob("*.py")
        if not any(parent.is_symlink() for parent in path.parents)
    )


def _room(path: Path, root: Path) -> str:
    parts = path.relative_to(root).parts
    return parts[0] if parts[0] != "bilateral_rl" else parts[1].removesuffix(".py")


def _imported(path: Path) -> list[str]:
    modules: list[str] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            modules += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module == "bilateral_rl":
            modules += [f"bilateral_rl.{alias.name}" for alias in node.names if not alias.name.startswith("__")]
        elif isinstance(node, ast.ImportFrom) and node.module:
            modules.append(node.module)
    return modules


def _knots(found: Counter[tuple[str, str]]) -> list[set[str]]:
    """Return the groups of rooms that import each other in circles (Tarjan's strongly connected components)."""
    names = sorted({room for pair in found for room in pair})
    reach = {room: {b for a, b in found if a == room} for room in names}
    for middle in names:
        for room in names:
            if middle in reach[room]:
                reach[room] |= reach[middle]
    groups = {frozenset(b for b in names if b in reach[a] and a in reach[b]) for a in names}
    return [set(group) for group in groups if len(group) > 1]


def main() -> None:
    """Print the map of the checkout that is given, or of this one."""
    root = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[2]
    found = imports(root)
    print(f"{len(rooms(root))} rooms, {len(found)} pairs of rooms, {sum(found.values())} imports between them")
    for knot in _knots(found):
        print(f"a knot of {len(knot)}: {', '.join(sorted(knot))}")
    if rooms(root) <= {room for floor in FLOORS for room in floor}:
        for number, floor in reversed(list(enumerate(FLOORS, start=1))):
            print(f"floor {number}: {' → '.join(floor)}")
        for a, b in upward(found):
            print(f"up: {a} → {b} ({found[a, b]})")
    for (a, b), n in sorted(found.items()):
        print(f"  {a} → {b}: {n}")


if __name__ == "__main__":
    main()
