"""Without what macOS and Windows lack, everything is imported, trains and is evaluated. No such machine ran it."""

import subprocess
import sys
from pathlib import Path

import other_systems

TRAIN = "train --timesteps 400 --n-envs 4 --set ppo.n_steps=10 --set ppo.batch_size=20"
TRAIN_SUPERVISED = "train --algo bptt --epochs 1 --set bptt.trials=64 --set bptt.validation_trials=8 --set threads=0"
RUN, SUPERVISED = "runs/random_reach/cc_s-ppo-1", "runs/random_reach/cc_s-bptt-1"
COMMANDS = [
    TRAIN,
    TRAIN_SUPERVISED,
    f"train --resume {RUN} --timesteps 800",
    f"train --resume {SUPERVISED} --epochs 2",
    f"evaluate {RUN} --trials 4",
    f"evaluate {SUPERVISED} --trials 4",
    "list",
]


def test_everything_is_imported_trains_and_is_evaluated(tmp_path):
    arguments = [sys.executable, "-X", "warn_default_encoding", other_systems.__file__, *COMMANDS]
    ended = subprocess.run(arguments, cwd=tmp_path, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / SUPERVISED / "weights/final.safetensors").is_file()
    assert "finished" in ended.stdout
    assert b"\r" not in (tmp_path / RUN / "config.yaml").read_bytes()


def test_what_is_taken_away_is_missed():
    code = "import other_systems; other_systems.become_another_system()\n__name__ = 'bilateral_rl.x'\nimport os\n{}"
    helpers = Path(other_systems.__file__).parent
    for line, is_there in (
        ("os.getpid()", True),
        ("os.sched_getaffinity(0)", False),
        ("os.O_NOFOLLOW", False),
        ("import fcntl", False),
        ("open(os.devnull).close()", False),
        ("open(os.devnull, encoding='utf-8').close()", True),
    ):
        arguments = [sys.executable, "-X", "warn_default_encoding", "-c", code.format(line)]
        ended = subprocess.run(arguments, cwd=helpers, capture_output=True)
        assert (ended.returncode == 0) == is_there, line
