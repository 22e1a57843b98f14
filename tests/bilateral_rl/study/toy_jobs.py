"""Work for the tests, of a module that imports nothing heavy."""

import os
import signal
import sys
import time
from pathlib import Path


def note(folder, name, what):
    """A line in a file that all jobs share, which tells tests what happened when."""
    with (Path(folder) / "events.txt").open("a") as file:
        file.write(f"{name} {what} {os.getpid()}\n")


def write(folder, progress, name, seconds=0.0, text="made", shared=None):
    note(shared or folder, name, "start")
    time.sleep(seconds)
    note(shared or folder, name, "end")
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text)


def tell(folder, progress, name):
    for done in (0.0, 0.25, 0.75):
        progress(done, f"step {done}")
    write(folder, progress, name)


def environment(folder, progress, name):
    print("to standard output")
    print("to standard error", file=sys.stderr)
    values = [os.environ["OMP_NUM_THREADS"], sys.stdin.read(), str("torch" in sys.modules)]
    (folder / name).write_text(",".join(values))


def fail(folder, progress):
    print("before it failed")
    raise ValueError("this is\nwrong")


def leave(folder, progress):
    print("before it left")
    os._exit(3)


def kill_itself(folder, progress):
    os.kill(os.getpid(), signal.SIGKILL)


def kill_the_node(folder, progress, name, shared):
    note(shared, name, "start")
    os.kill(os.getppid(), signal.SIGKILL)
    time.sleep(60)


def forget(folder, progress):
    pass


def save_when_asked(folder, progress, name):
    """Its first stretch lasts until somebody interrupts it; the second is the end."""
    state = folder / f"{name}.count"
    count = int(state.read_text()) + 1 if state.exists() else 1
    if count == 1:
        try:
            note(folder, name, "start")
            progress(0.0, "ready")
            time.sleep(60)
        except KeyboardInterrupt:
            time.sleep(0.3)  # a second SIGINT would be seen here
            note(folder, name, "saved")
            state.write_text(str(count))
            return
    (folder / name).write_text(f"{count} stretches")


def ignore_interrupts(folder, progress):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    note(folder, "stubborn", "start")
    progress(0.0, "ready")
    time.sleep(60)


def chatter(folder, progress, name):
    began = time.monotonic()
    for i in range(100_000):
        progress(i / 100_000, "same")
    (folder / name).write_text(str(time.monotonic() - began))
