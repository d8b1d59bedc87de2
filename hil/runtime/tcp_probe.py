"""The TCP responder beside a controller: a process of its own, because it may not cost a control cycle.

A thread would not do: it shares the interpreter's lock with the control loop, and whoever holds that may be put aside
by any program of the machine. Measured so with a flood of messages: cycles were missed, also under SCHED_FIFO.
"""

import asyncio
import json
import subprocess
from collections.abc import Callable
from contextlib import suppress

from hil.values.errors import EndpointError
from hil.values.link import Address
from hil.values.tcp_probe import Behaviour
from transport.child import module_command, module_environment, terminal_signals_blocked
from transport.tcp.sockets import listen

_SERVER = "hil.runtime.tcp_probe_main"
_BACKLOG = 8
_CLOSING_S = 2.0


class TcpProbe:
    """Serves from its making until ``close``, which is idempotent. ``say`` is told if it ends before.

    Raises :class:`EndpointError` where it cannot listen. For use in an event loop.
    """

    def __init__(self, bind: Address, behaviour: Behaviour, *, say: Callable[[str], None]) -> None:
        self.behaviour = behaviour
        self.fault: str | None = None
        self._say = say
        self._figures: dict[str, object] = {}
        self._loop = asyncio.get_running_loop()
        listener = listen(bind, backlog=_BACKLOG)
        self.local = Address(*listener.getsockname())
        try:
            with terminal_signals_blocked():
                self._process = subprocess.Popen(
                    module_command(_SERVER, str(listener.fileno()), behaviour.value),
                    pass_fds=(listener.fileno(),),
                    env=module_environment(),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                )
        except OSError as error:
            raise EndpointError(f"the responder's process cannot be started: {error.strerror or error}") from error
        finally:
            listener.close()
        self._open = True
        if self._process.stdout is not None:
            self._loop.add_reader(self._process.stdout.fileno(), self._ended_early)

    def close(self) -> None:
        """End it, and take what it reports."""
        if not self._open:
            return
        self._open = False
        if self._process.stdout is not None:
            self._loop.remove_reader(self._process.stdout.fileno())
        try:
            out, complaint = self._process.communicate(timeout=_CLOSING_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            out, complaint = self._process.communicate()
        with suppress(ValueError):
            self._figures = json.loads(out)
        if not self._figures:
            last_line = complaint.decode(errors="replace").strip().rpartition("\n")[2]
            self.fault = f"its process ended with code {self._process.returncode} before its report" + (
                f" ({last_line})" if last_line else ""
            )

    def report(self) -> dict[str, object]:
        """Return what it did, for JSON; complete once it is closed."""
        return {
            "address": str(self.local),
            "behaviour": self.behaviour.value,
            "fault": self.fault,
            **self._figures,
        }

    def _ended_early(self) -> None:
        self.close()
        self._say(f"tcp probe: nobody answers at {self.local} any more: {self.fault or 'it ended by itself'}")
