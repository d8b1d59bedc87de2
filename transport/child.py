"""Starting a process of ours that must not share an interpreter with the control loop."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_SOURCE_ROOT = Path(__file__).resolve().parents[1]
"""The folder that holds the packages, which the child must find wherever it is started."""
_TERMINAL_SIGNALS = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}


def module_command(module: str, *arguments: str) -> list[str]:
    """Return the command that runs ``module`` with this interpreter."""
    # -P: a file of the user's folder must not pass for a module
    return [sys.executable, "-P", "-m", module, *arguments]


def module_environment() -> dict[str, str]:
    """Return the environment in which our modules are found."""
    search_path = os.pathsep.join(filter(None, [str(_SOURCE_ROOT), os.environ.get("PYTHONPATH")]))
    return {**os.environ, "PYTHONPATH": search_path}


@contextmanager
def terminal_signals_blocked() -> Iterator[None]:
    """A process started inside is born with these signals blocked, and they stay so.

    A handler it installs itself would come too late for a Ctrl-C in its first milliseconds.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _TERMINAL_SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
