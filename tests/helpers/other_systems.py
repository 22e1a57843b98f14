"""This machine as macOS and Windows: what one of them lacks is there for libraries, but not for the toolkit.

Run as a script with commands of ``bilateral-rl``, one an argument: imports every module, then runs them.
"""

import builtins
import importlib
import os
import pkgutil
import signal
import sys
import types
import warnings

_OS = """
sched_getaffinity sched_setaffinity memfd_create
O_CLOEXEC O_NOFOLLOW O_NONBLOCK O_NOCTTY O_DIRECTORY O_SYNC fork forkpty killpg kill getpgid setpgid setsid getsid
getuid geteuid getgid mkfifo mknod chown uname wait wait3 wait4 nice register_at_fork posix_spawn fchmod statvfs
getloadavg sysconf
"""
_SIGNAL = """
SIGKILL SIGHUP SIGALRM SIGUSR1 SIGPIPE SIGSTOP SIGCONT SIGXFSZ alarm pause setitimer pthread_sigmask pthread_kill
sigwait
"""
MISSING = {"os": {*_OS.split()}, "signal": {*_SIGNAL.split()}}
"""Windows lacks all of it (its ``kill`` ends what it should only ask), macOS the first line of ``os``."""
MODULES = {"fcntl", "resource", "termios", "pwd", "grp", "pty", "tty", "syslog", "posix"}
"""Windows lacks them all."""


def _is_ours(namespace):
    return namespace is not None and str(namespace.get("__name__", "")).startswith("bilateral_rl")


def become_another_system():
    """Take away what the other systems lack, from modules of the toolkit only."""

    class Lacking(types.ModuleType):
        def __getattribute__(self, name):
            module = types.ModuleType.__getattribute__(self, "__name__")
            if name in MISSING[module] and _is_ours(sys._getframe(1).f_globals):
                raise AttributeError(f"module {module!r} has no attribute {name!r}")
            return types.ModuleType.__getattribute__(self, name)

    def lacking_import(name, globals=None, *arguments, **named):
        if name in MODULES and _is_ours(globals):
            raise ModuleNotFoundError(f"No module named {name!r}")
        return plain_import(name, globals, *arguments, **named)

    plain_import, builtins.__import__ = builtins.__import__, lacking_import
    os.__class__ = signal.__class__ = Lacking
    # Windows reads and writes text in an old encoding unless told which. Needs ``python -X warn_default_encoding``.
    warnings.filterwarnings("error", category=EncodingWarning, module=r"bilateral_rl\.")


def main():
    become_another_system()
    import bilateral_rl

    for module in pkgutil.walk_packages(bilateral_rl.__path__, "bilateral_rl."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    from bilateral_rl.commands import app

    for command in sys.argv[1:]:
        sys.argv = ["bilateral-rl", *command.split()]
        try:
            app.main()
        except SystemExit as end:
            if end.code:
                raise


if __name__ == "__main__":
    main()
