"""Commands in processes of their own, to be watched, stopped and killed."""

import contextlib
import multiprocessing
import os
import resource
import sys
import time
from multiprocessing.connection import Connection

import torch

from bilateral_rl.commands import app as cli
from bilateral_rl.study import entry
from bilateral_rl.training import one_seed

TIMEOUT = 120.0

_processes = multiprocessing.get_context("forkserver")
# Importing everything takes seconds: one process does it, and every command is a copy of it.
_processes.set_forkserver_preload(
    ["bilateral_rl.commands.train", "bilateral_rl.commands.evaluate", "bilateral_rl.study.model_job"]
)


@contextlib.contextmanager
def in_process(function, *arguments, output):
    """``function`` in a process that does not outlive the context; what it prints goes into the file ``output``."""
    process = _processes.Process(target=_call, args=(function, arguments, str(output)))
    process.start()
    try:
        yield process
    finally:
        process.kill()
        process.join()


def started(*arguments, output, largest_file=None):
    """``bilateral-rl`` as :func:`in_process`; it can write no file larger than ``largest_file`` bytes."""
    return in_process(_limited_command, [*map(str, arguments)], largest_file, output=output)


def finished(*arguments, output, largest_file=None):
    """The exit code and output of a whole command."""
    with started(*arguments, output=output, largest_file=largest_file) as process:
        process.join(TIMEOUT)
        return process.exitcode, output.read_text()


def command(*arguments):
    """The exit code of ``bilateral-rl``, in this process."""
    sys.argv = ["bilateral-rl", *map(str, arguments)]
    try:
        cli.main()
    except SystemExit as end:
        return end.code or 0
    return 0


class CopiedSeed:
    """The process of one seed as its run starts it, but as a copy of one that has imported everything.

    Args:
        arguments: of ``subprocess.Popen``, of which the last is the folder of the seed.
        options: likewise; not needed here.
    """

    def __init__(self, arguments, **options):
        stdin, ask = _processes.Pipe(duplex=False)
        hear, stdout = _processes.Pipe(duplex=False)
        self._process = _processes.Process(target=_train_seed, args=(arguments[-1], stdin, stdout), daemon=True)
        self._process.start()
        self.stdin, self.stdout = os.fdopen(os.dup(ask.fileno()), "w"), os.fdopen(os.dup(hear.fileno()))
        for end in (stdin, ask, hear, stdout):
            end.close()

    def kill(self):
        self._process.kill()

    def wait(self):
        self._process.join()
        return self._process.exitcode


class CopiedJob:
    """The process of a job as its study starts it, likewise a copy.

    Args:
        arguments: of ``subprocess.Popen``, of which the last is the number of the job's end of a pipe.
        stdout: the open log.
        options: not needed here.
    """

    def __init__(self, arguments, stdout, **options):
        with Connection(os.dup(int(arguments[-1]))) as pipe:
            self._process = _processes.Process(target=_do_job, args=(pipe, stdout.name), daemon=True)
            self._process.start()
        self.pid = self._process.pid

    def poll(self):
        return self._process.exitcode

    def wait(self):
        self._process.join()
        return self._process.exitcode

    def send_signal(self, number):
        os.kill(self.pid, number)


def wait_until(condition, process, output, pause=0.001):
    deadline = time.monotonic() + TIMEOUT
    while not condition():
        assert process.is_alive(), f"it ended too early: {output.read_text()}"
        assert time.monotonic() < deadline
        time.sleep(pause)


def is_saving(path):
    """Whether a run's state is being written at this moment."""
    return any(entry.name.startswith(".resume.safetensors.") for entry in os.scandir(path))


def _call(function, arguments, output):
    handle = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(handle, 1)
    os.dup2(handle, 2)
    sys.exit(function(*arguments))


def _train_seed(folder, stdin, stdout):
    os.setsid()
    os.dup2(stdin.fileno(), 0)
    os.dup2(stdout.fileno(), 1)
    stdin.close()
    stdout.close()
    sys.stdin, sys.argv = os.fdopen(0), ["one_seed", folder]
    sys.exit(one_seed.main())


def _do_job(pipe, log):
    os.setsid()
    handle = os.open(log, os.O_WRONLY | os.O_APPEND)
    os.dup2(handle, 1)
    os.dup2(handle, 2)
    torch.set_num_threads(1)
    sys.argv = ["entry", str(os.dup(pipe.fileno()))]
    pipe.close()
    sys.exit(entry.main())


def _limited_command(arguments, largest_file):
    if largest_file is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))
    return command(*arguments)
