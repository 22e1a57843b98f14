"""Output that nobody reads or that cannot be written: what was computed is there all the same, without a traceback."""

import os
import subprocess
import sys

CUT, FULL = 141, 1


def bilateral_rl(folder, arguments, stdout):
    command = [sys.executable, "-m", "bilateral_rl.commands.app", *map(str, arguments)]
    return subprocess.Popen(command, cwd=folder, stdout=stdout, stderr=subprocess.PIPE, text=True)


def cut(folder, *arguments):
    """``bilateral-rl … | head -0``: the exit code and the errors."""
    reader, writer = os.pipe()
    os.close(reader)
    with bilateral_rl(folder, arguments, writer) as process:
        os.close(writer)
        return process.communicate()[1], process.returncode


def full(folder, *arguments):
    """``bilateral-rl … > /dev/full``: the exit code and the errors."""
    with open("/dev/full", "w") as device, bilateral_rl(folder, arguments, device) as process:  # noqa: PTH123
        return process.communicate()[1], process.returncode


def test_results_are_written_although_nobody_reads_the_output(run, tmp_path):
    """With the other commands: ``test_printing_fails.py``."""
    assert cut(tmp_path, "evaluate", run.path, "--trials", 4, "--csv", "results.csv") == ("", CUT)
    assert (tmp_path / "results.csv").read_text().count("\n") > 1


def test_a_full_device_is_told_in_a_sentence(tmp_path):
    assert full(tmp_path, "list") == ("Error: Not all could be printed: No space left on device.\n", FULL)
