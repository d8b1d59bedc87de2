"""The page beside a controller: a process of its own, with less of the processor where that is short.

Drawing takes whole milliseconds of an interpreter; a control cycle must not wait for it.
"""

import asyncio
import os
import subprocess
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

from hil.values.errors import EndpointError
from transport.child import module_command, module_environment, terminal_signals_blocked

_COMMAND_LINE: Final = "hil.cli.main"
_NICER: Final = 10
_NICEST: Final = 19
_CLOSING_S: Final = 5.0


class ViewPlace(NamedTuple):
    """Where the page is served; the next free port is taken where that one is not."""

    host: str = "127.0.0.1"
    port: int = 8080
    station: Path | None = None
    """Station file, beside which the choices made in the page are kept."""


class ViewProcess:
    """Runs ``hil view`` from its making until ``close``, which is idempotent. ``say`` is told if it ends before.

    It ends when its standard input does, so it does not outlive a controller that was killed. What it says goes where
    this process's standard error goes. For use in an event loop; raises :class:`EndpointError` where it cannot start.
    """

    def __init__(self, place: ViewPlace, pad: Path, *, say: Callable[[str], None]) -> None:
        self._say = say
        self._loop = asyncio.get_running_loop()
        arguments: tuple[str, ...] = (
            "view",
            "--socket",
            str(pad),
            "--host",
            place.host,
            "--port",
            str(place.port),
            "--end-with-input",
        )
        if place.station is not None:
            arguments += ("--station", str(place.station))
        try:
            with terminal_signals_blocked():
                self._process = subprocess.Popen(
                    module_command(_COMMAND_LINE, *arguments),
                    env=module_environment(),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                )
        except OSError as error:
            raise EndpointError(f"the view's process cannot be started: {error.strerror or error}") from error
        # Nicer than we are, who may be nice ourselves: the other way is not allowed to everybody.
        nice = min(os.getpriority(os.PRIO_PROCESS, 0) + _NICER, _NICEST)
        with suppress(OSError):  # a sandbox may forbid it; the page is served all the same
            os.setpriority(os.PRIO_PROCESS, self._process.pid, nice)
        self._open = True
        if self._process.stdout is not None:
            self._loop.add_reader(self._process.stdout.fileno(), self._ended_early)

    def close(self) -> int:
        """End it; return its exit code."""
        if self._open:
            self._open = False
            if self._process.stdout is not None:
                self._loop.remove_reader(self._process.stdout.fileno())
            try:
                self._process.communicate(timeout=_CLOSING_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.communicate()
        return self._process.returncode

    def _ended_early(self) -> None:
        if self._process.stdout is None or not os.read(self._process.stdout.fileno(), 4096):
            self._say(f"view: nobody sees the robots any more: hil view ended with code {self.close()}")
