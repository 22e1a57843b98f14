"""Whatever is given to a public door works or is refused in a sentence, and no kernel leaves its arrays."""

import re
import subprocess
import sys
from pathlib import Path

FUZZING = Path(__file__).parents[1] / "helpers" / "door_fuzzing.py"
INPUTS, CHILDREN = 504, 2


def test_a_thousand_inputs_of_any_shape_type_and_content():
    """In processes whose kernels assert every index; that they do is tried first, on a row that is read behind."""
    command = [sys.executable, str(FUZZING), str(INPUTS), str(CHILDREN)]
    finished = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False)
    assert finished.returncode == 0, finished.stderr[-5000:]
    assert "as it should, a process ended with -" in finished.stdout
    doors = re.findall(r"^([a-z ',]+?) +([\d,]+) +([\d,]+)$", finished.stdout, re.MULTILINE)
    outcomes = {name: (int(works), int(refused)) for name, works, refused in doors}
    assert sum(map(sum, outcomes.values())) == INPUTS * CHILDREN
    assert len(outcomes) == 18
    assert all(works and refused for works, refused in outcomes.values()), outcomes
