"""Where the operator's pad reaches the robots of this process: a Unix socket that only its owner may open.

A control cycle must not wait for a pad: of all connections together one request is done in a pass of the event loop,
nobody is waited for who does not read, and a pad that asks too often is read more slowly.
"""

import asyncio
import json
import os
import socket
import struct
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final, Protocol

from hil.clock import Clock
from hil.config.ring import RingSize
from hil.runtime.pad_connection import Connection, Message
from hil.runtime.pad_requests import BadRequest, CaptureRequest, PadRequest, read_request
from hil.runtime.pad_socket import PadSocket
from hil.values.errors import ConfigurationError, HilError
from hil.values.operator import OperatorAction, PadKey, Press

MAX_CONNECTIONS: Final = 16
SETTLE_S: Final = 0.01
"""From an action to its answer, so that the state in it is what the control cycles made of the action."""
CHANGES_INTERVAL_S: Final = 0.02
"""Between two lines for a watcher; what changed meanwhile is in the next one."""
HEARTBEAT_S: Final = 1.0
_BACKLOG: Final = 64
_ENABLE: Final = Press(PadKey.ENABLE)
_RELEASE: Final = Press(PadKey.RELEASE)
_EMERGENCY_STOP: Final = Press(PadKey.EMERGENCY_STOP)


class PadRobot(Protocol):
    """A robot as the pad sees it."""

    @property
    def moves_real_drives(self) -> bool:
        """Whether its robot side does."""

    def operate(self, action: OperatorAction) -> str:
        """Do what the operator did, now; return why that changes nothing, or an empty text."""

    def operator_state(self) -> dict[str, object]:
        """Return what the pad shows; what JSON can say."""

    def description(self) -> dict[str, object]:
        """Return what stays the same while it runs; what JSON can say."""

    def kst_report(self) -> dict[str, object] | None:
        """Return what its KST server did; what JSON can say. None where it has none."""


class PadCaptures(Protocol):
    """The recordings of the run as the pad sees them."""

    def start(self, writer: Path, file: Path, ring: RingSize | None) -> str:
        """Begin one; return why not, or an empty text."""

    def stop(self) -> str:
        """End the one that runs; return why not, or an empty text."""

    def report(self) -> dict[str, object] | None:
        """Return what is known of the last one."""


class OperatorChannel:
    """Binds in ``open``, serves from ``serve`` to ``close``. ``place`` is the socket's path; None: one is chosen.

    ``objects`` is what stands around the robots, for whoever draws it.
    """

    def __init__(
        self,
        place: str | None,
        robots: Mapping[str, PadRobot],
        *,
        clock: Clock,
        captures: PadCaptures | None = None,
        objects: Sequence[Mapping[str, object]] = (),
    ) -> None:
        self._place = place
        self._captures = captures
        self._objects = list(objects)
        self._robots = robots
        self._clock = clock
        self._socket: PadSocket | None = None
        self._server: asyncio.Server | None = None
        self._connections: set[Connection] = set()
        self._holders: dict[str, Connection] = {}
        self._waiting: deque[tuple[Connection, bytes]] = deque()
        self._timers: dict[str, asyncio.TimerHandle] = {}
        self._told_ns = -1_000_000_000
        self.path = Path()
        self.requests = self.refused = self.lost_lines = 0

    def open(self) -> None:
        """Bind the socket, and remove those of dead processes beside it; raise :class:`ConfigurationError`."""
        self._socket = PadSocket(self._place)
        self.path = self._socket.path

    async def serve(self) -> None:
        """Take connections from now on."""
        if self._socket is None:
            raise ConfigurationError("the operator's channel is not open")
        loop = asyncio.get_running_loop()
        self._server = await loop.create_unix_server(
            lambda: Connection(self, now_ns=self._clock.now_ns), sock=self._socket.link, backlog=_BACKLOG
        )
        self._after("heartbeat", HEARTBEAT_S, self._beat)

    def changed(self) -> None:
        """Something happened to a robot: tell those who watch, soon."""
        if "changes" not in self._timers and any(connection.watched for connection in self._connections):
            passed_s = (self._clock.now_ns() - self._told_ns) / 1e9
            self._after("changes", max(0.0, CHANGES_INTERVAL_S - passed_s), self._tell_changes)

    def close(self) -> None:
        """Say goodbye, close every connection, and remove the socket; idempotent."""
        for timer in self._timers.values():
            timer.cancel()
        self._timers.clear()
        self._holders.clear()
        self._waiting.clear()
        for connection in list(self._connections):
            connection.end("the controller shuts down")
        self._connections.clear()
        if self._server is not None:
            self._server.close()
            self._server = None
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def report(self) -> dict[str, object]:
        """Return the pad's part of the status file."""
        return {
            "socket": str(self.path),
            "requests": self.requests,
            "refused": self.refused,
            "lost_lines": self.lost_lines,
        }

    def joined(self, connection: Connection, link: socket.socket) -> str:
        """Take a connection, or return why not."""
        user = peer_user(link)
        if user is not None and user not in {0, os.geteuid()}:
            return f"only user {os.geteuid()}, whose controller this is, may use its pad; this is user {user}"
        if len(self._connections) >= MAX_CONNECTIONS and not self._let_go_an_idle_one():
            return f"{MAX_CONNECTIONS} pads that hold or watch are connected, which is the most; close one of them"
        self._connections.add(connection)
        return ""

    def _let_go_an_idle_one(self) -> bool:
        """Make room: whoever wants to stop the arm must not wait for pads that do nothing."""
        held = set(self._holders.values())
        idle = [one for one in self._connections if not one.watched and one not in held]
        if not idle:
            return False
        oldest = min(idle, key=lambda one: one.used_ns)
        oldest.end(f"more than {MAX_CONNECTIONS} pads are connected, and this one did nothing for the longest time")
        self._connections.discard(oldest)
        return True

    def left(self, connection: Connection) -> None:
        """A connection ended: let go what it held, and forget what it asked for and cannot be answered."""
        self._connections.discard(connection)
        if any(one is connection for one, _ in self._waiting):
            self._waiting = deque(waiting for waiting in self._waiting if waiting[0] is not connection)
        for name in [name for name, holder in self._holders.items() if holder is connection]:
            del self._holders[name]
            self._robots[name].operate(_RELEASE)

    def queue(self, connection: Connection, line: bytes) -> None:
        """Do a request in one of the next passes of the event loop."""
        self._waiting.append((connection, line))
        if len(self._waiting) == 1:
            asyncio.get_running_loop().call_soon(self._do_next)

    def _do_next(self) -> None:
        if not self._waiting:
            return
        # The next one is called for first: nothing that goes wrong with this one may end the chain.
        connection, line = self._waiting.popleft()
        if self._waiting:
            asyncio.get_running_loop().call_soon(self._do_next)
        if connection not in self._connections:
            return
        self.requests += 1
        request = read_request(line)
        try:
            refusal = request.reason if isinstance(request, BadRequest) else self._done(request, connection)
        except HilError as error:
            refusal = str(error)
        if refusal:
            self.refused += 1
            self._refuse(connection, request, refusal)
        elif isinstance(request, PadRequest) and request.action is not None:
            asyncio.get_running_loop().call_later(SETTLE_S, self._answer, connection, request)
        elif isinstance(request, PadRequest):
            self._answer(connection, request)

    def _done(self, request: PadRequest, connection: Connection) -> str:
        """Do it; return why not, or an empty text."""
        if request.capture is not None:
            return self._capture(request.capture)
        names = self._addressed(request)
        if not names:
            valid = ", ".join(self._robots)
            if request.robot is None:
                return f"this controller has {len(self._robots)} robots: say which one (robot); valid: {valid}"
            return f"there is no robot {json.dumps(request.robot)[:80]}; valid: {valid}"
        if request.watch:
            connection.watch(names, request.request_id)
        if request.action is None:
            return ""
        told = [self._operate(name, request.action, connection if request.hold else None) for name in names]
        return "; ".join(refusal for refusal in told if refusal)

    def _capture(self, request: CaptureRequest) -> str:
        if self._captures is None:
            return "this controller records nothing"
        if not request.writer:
            return self._captures.stop()
        return self._captures.start(Path(request.writer), Path(request.file), request.ring)

    def _addressed(self, request: PadRequest) -> list[str]:
        if request.robot is not None:
            return [request.robot] if request.robot in self._robots else []
        # Looking needs no choice; and whoever has no time to choose must stop everything.
        if len(self._robots) == 1 or request.action in {None, _EMERGENCY_STOP}:
            return list(self._robots)
        return []

    def _operate(self, name: str, action: OperatorAction, holder: Connection | None) -> str:
        robot = self._robots[name]
        if action == _ENABLE:
            if holder is None and robot.moves_real_drives:
                return (
                    f"{name} moves real drives: its enabling switch must be held by a pad that stays connected "
                    f"(hil pad enable --hold)"
                )
            if holder is not None and self._holders.get(name, holder) is not holder:
                return f"another pad holds the enabling switch of {name}; let it go there, or here (hil pad release)"
        refusal = robot.operate(action)
        if not refusal and holder is not None:
            self._holders[name] = holder
        elif not refusal and action == _RELEASE:
            self._holders.pop(name, None)
        return refusal

    def _answer(self, connection: Connection, request: PadRequest) -> None:
        names = list(self._robots) if request.capture is not None else self._addressed(request)
        if request.describe:
            robots = {name: self._robots[name].description() for name in names}
            connection.answer({"ok": True, "robots": robots, "objects": self._objects}, request.request_id)
            return
        if request.kst:
            reports = {name: self._robots[name].kst_report() for name in names}
            connection.answer({"ok": True, "robots": reports}, request.request_id)
            return
        told: Message = {"ok": True, "robots": self._states(names)}
        if self._captures is not None:
            told["capture"] = self._captures.report()
        connection.answer(told, request.request_id)

    def _refuse(self, connection: Connection, request: PadRequest | BadRequest, reason: str) -> None:
        told: Message = {"ok": False, "error": reason}
        if isinstance(request, PadRequest) and (names := self._addressed(request)):
            told["robots"] = self._states(names)
        connection.answer(told, request.request_id)

    def _states(self, names: list[str]) -> dict[str, Message]:
        return {name: self._robots[name].operator_state() for name in names}

    def _beat(self) -> None:
        self._after("heartbeat", HEARTBEAT_S, self._beat)
        self._tell(always=True)

    def _tell_changes(self) -> None:
        del self._timers["changes"]
        self._tell(always=False)

    def _tell(self, *, always: bool) -> None:
        watchers = [connection for connection in self._connections if connection.watched]
        if not watchers:
            return
        self._told_ns = self._clock.now_ns()
        states = self._states(list(self._robots))
        for connection in watchers:
            connection.show({name: states[name] for name in connection.watched}, always=always)

    def _after(self, name: str, delay_s: float, action: Callable[[], None]) -> None:
        self._timers[name] = asyncio.get_running_loop().call_later(delay_s, action)


def peer_user(link: socket.socket) -> int | None:
    """Return the user at the other end; None where the system does not tell."""
    option = getattr(socket, "SO_PEERCRED", None)
    if option is None:
        return None
    _process, user, _group = struct.unpack("3i", link.getsockopt(socket.SOL_SOCKET, option, struct.calcsize("3i")))
    return int(user)
