"""The KST server beside a controller: a process of its own, an application at the robot's servo link.

It reads a state every cycle and answers a program that waits for each answer; neither may cost a control cycle.
"""

import asyncio
import json
import os
import subprocess
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Final

from hil.values.errors import EndpointError
from hil.values.kst import KstSettings
from hil.values.link import Address
from transport.child import module_command, module_environment, terminal_signals_blocked
from transport.tcp.sockets import listen

_SERVER: Final = "hil.runtime.kst_main"
_BACKLOG: Final = 50
"""That of a published server."""
_CLOSING_S: Final = 5.0
_LINE_MOST_BYTES: Final = 1 << 20


class KstProcess:
    """Serves from :meth:`start` until ``close``, which is idempotent. ``say`` is told what happens there.

    Raises :class:`EndpointError` where it cannot listen. For use in an event loop.
    """

    def __init__(self, bind: Address, settings: KstSettings, *, say: Callable[[str], None]) -> None:
        self.settings = settings
        self.fault: str | None = None
        self._say = say
        self._figures: dict[str, object] = {}
        self._rest = b""
        self._loop = asyncio.get_running_loop()
        self._listener = listen(bind, backlog=_BACKLOG)
        self.local = Address(*self._listener.getsockname())
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, controller: Address, *, state_period_ms: int, key_file: Path | None) -> None:
        """Begin to serve, with the controller's servo link at ``controller``; raise :class:`EndpointError`."""
        wishes = {
            "controller": str(controller),
            "state_period_ms": state_period_ms,
            "key_file": None if key_file is None else str(key_file.absolute()),
            "settings": asdict(self.settings),
        }
        try:
            with terminal_signals_blocked():
                self._process = subprocess.Popen(
                    module_command(_SERVER, str(self._listener.fileno()), json.dumps(wishes)),
                    pass_fds=(self._listener.fileno(),),
                    env=module_environment(),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                )
        except OSError as error:
            raise EndpointError(f"the KST server's process cannot be started: {error.strerror or error}") from error
        finally:
            self._listener.close()
        if self._process.stdout is not None:
            os.set_blocking(self._process.stdout.fileno(), False)
            self._loop.add_reader(self._process.stdout.fileno(), self._read)

    def close(self) -> None:
        """End it, and take what it reports."""
        self._listener.close()
        process, self._process = self._process, None
        if process is None:
            return
        if process.stdout is not None:
            self._loop.remove_reader(process.stdout.fileno())
            os.set_blocking(process.stdout.fileno(), True)
        try:
            out, _ = process.communicate(timeout=_CLOSING_S)
        except subprocess.TimeoutExpired:
            process.kill()
            out, _ = process.communicate()
        self._take(out)
        if process.returncode:
            self.fault = f"its process ended with code {process.returncode}"

    def report(self) -> dict[str, object]:
        """Return what it did, for JSON; complete once it is closed."""
        return {"address": str(self.local), "fault": self.fault, **self._figures}

    def _read(self) -> None:
        process = self._process
        if process is None or process.stdout is None:
            return
        try:
            data = os.read(process.stdout.fileno(), 1 << 16)
        except BlockingIOError:
            return
        if data:
            self._take(data)
            return
        self.close()
        self._say(f"kst: nobody serves {self.local} any more{f': {self.fault}' if self.fault else ''}")

    def _take(self, data: bytes) -> None:
        *lines, self._rest = (self._rest + data).split(b"\n")
        self._rest = self._rest[-_LINE_MOST_BYTES:]
        for line in lines:
            with suppress(ValueError):
                message = json.loads(line)
                if "say" in message:
                    self._say(f"kst: {message['say']}")
                elif "report" in message:
                    self._figures = message["report"]
