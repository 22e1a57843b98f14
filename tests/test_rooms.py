"""Dependencies point one way: the order of the rooms that CONTRIBUTING.md shows."""

from pathlib import Path

import pytest
from rooms import ALONE, FLOORS, imports, rooms, upward

ROOT = Path(__file__).parents[1]


def test_every_room_has_a_place():
    known = {room for floor in FLOORS for room in floor}
    assert rooms(ROOT) <= known, "a new room needs a floor in tests/helpers/rooms.py, and a line in CONTRIBUTING.md"
    assert known == rooms(ROOT), "FLOORS names a room that is gone"


def test_no_import_leads_up():
    assert upward(imports(ROOT)) == []


@pytest.mark.parametrize("room", ALONE)
def test_world_and_brain_know_nothing_of_each_other_or_of_the_study(room):
    assert {b for a, b in imports(ROOT) if a == room} <= ALONE[room]


def test_an_import_that_leads_up_is_found(tmp_path):
    (tmp_path / "bilateral_rl" / "io").mkdir(parents=True)
    (tmp_path / "bilateral_rl" / "io" / "a.py").write_text("def late():\n    from bilateral_rl.commands import app\n")
    assert upward(imports(tmp_path)) == [("io", "commands")]
