"""Who may come to the page, and what he may say there: viser itself believes every socket every word.

A page elsewhere on the web can open a socket to this machine, and point a name of its own at it (DNS rebinding): it is
refused by what its browser says of it. Who has no token says only where he looks from and what he typed. Nobody can
ask for viser's share tunnel, which would show the robots to the world, or set anything but the value of an element.
"""

import asyncio
import contextlib
import ipaddress
import math
import socket
from collections.abc import Callable, Iterator
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import urlsplit

import websockets
import websockets.asyncio.server
from viser._messages import Message

from hil.clock import MonotonicClock
from tools.view.token import same_token

MAX_OPERATORS: Final = 8
MAX_LOOKERS: Final = 32
MAX_MESSAGE_BYTES: Final = 1 << 16
LOOKERS_MESSAGES_PER_S: Final = 100.0
"""And as many at once: a browser says some 50 times a second where it looks from while that changes."""
_LONGEST_TEXT: Final = 4096
_LOOKING: Final = frozenset({"ViewerCameraMessage", "GuiUpdateMessage"})
_ACTING: Final = _LOOKING | {"GuiButtonHoldMessage", "SceneNodeDragMessage"}
_NS: Final = 1_000_000_000

Handler = Callable[[Any], Any]


class Gate:
    """Stands before the servers that are made inside of :meth:`standing`."""

    def __init__(self, token: str, host: str) -> None:
        self._token = token
        machine = socket.gethostname().lower()
        self._names = frozenset({"localhost", host.lower(), machine, f"{machine}.local"})
        self._guests: set[Guest] = set()

    @contextlib.contextmanager
    def standing(self) -> Iterator[None]:
        """Let what is served from within be served through this gate: viser has no place for one of its own."""
        serve = websockets.asyncio.server.serve

        def guarded(handler: Handler, host: str, port: int, **options: Any) -> Any:
            inner = options["process_request"]

            def process_request(connection: Any, request: Any) -> Any:
                refusal = self.refusal(request.headers)
                return (
                    connection.respond(HTTPStatus.FORBIDDEN, f"{refusal}\n") if refusal else inner(connection, request)
                )

            async def handle(connection: Any) -> None:
                await self._admit(connection, handler)

            more = {"process_request": process_request, "max_size": MAX_MESSAGE_BYTES}
            return serve(handle, host, port, **{**options, **more})

        websockets.asyncio.server.serve = guarded  # type: ignore[assignment,misc]
        try:
            yield
        finally:
            websockets.asyncio.server.serve = serve  # type: ignore[misc]

    def refusal(self, headers: Any) -> str:
        """Return why a request is refused because of where it comes from; empty for one that is served."""
        hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
        if len(hosts) != 1 or len(origins) > 1:
            return "say once where you want to go, and at most once where you come from"
        host = hosts[0]
        if not self._known(host):
            return f"the page is served at its address, not as {host!r}"
        # Programs have no origin; a browser names that of the page which opens the socket.
        if origins and not _same_place(origins[0], host):
            return f"a page of {origins[0]!r} may not look at the robots"
        return ""

    def _known(self, host: str) -> bool:
        name = _name_of(host)
        with contextlib.suppress(ValueError):
            ipaddress.ip_address(name)
            return True
        return name in self._names

    async def _admit(self, connection: Any, handler: Handler) -> None:
        guest = Guest(connection, acts=same_token(connection.request.path.strip("/"), self._token))
        alike = sum(other.acts == guest.acts for other in self._guests)
        most = MAX_OPERATORS if guest.acts else MAX_LOOKERS
        if alike >= most:
            await connection.close(1013, f"{most} browsers are here already, which is the most")
            return
        self._guests.add(guest)
        try:
            await handler(guest)
        finally:
            self._guests.discard(guest)


class Guest:
    """A browser's socket, as viser is given it; ``acts`` is set for who has the token."""

    def __init__(self, connection: Any, *, acts: bool) -> None:
        self.acts = acts
        self._connection = connection
        self._clock = MonotonicClock()
        self._left = LOOKERS_MESSAGES_PER_S
        self._counted_ns = self._clock.now_ns()

    @property
    def request(self) -> Any:
        """What the socket was opened with."""
        return self._connection.request

    @property
    def subprotocol(self) -> str | None:
        """Which version of viser the page has."""
        chosen: str | None = self._connection.subprotocol
        return chosen

    async def send(self, data: bytes) -> None:
        """Send to the browser."""
        await self._connection.send(data)

    async def close(self, code: int = 1000, reason: str = "") -> None:
        """Send the browser away."""
        await self._connection.close(code, reason)

    async def recv(self) -> bytes:
        """Return the next message that the guest may send; one that is no message ends the connection."""
        while True:
            raw = await self._connection.recv()
            if not self.acts:
                await self._take_time()
            if (allowed := self._allowed(raw)) is None:
                await self.close(1008, "that is no message of this page")
            elif allowed:
                return bytes(raw)

    def _allowed(self, raw: object) -> bool | None:
        """Whether viser may be told; None for what it could not even read."""
        if not isinstance(raw, bytes):
            return None
        try:
            message: Any = Message.deserialize(raw)
        except Exception:  # noqa: BLE001  # whatever a stranger's bytes make of it
            return None
        kind = type(message).__name__
        if kind not in (_ACTING if self.acts else _LOOKING):
            return False
        return kind != "GuiUpdateMessage" or _only_a_value(message.updates)

    async def _take_time(self) -> None:
        """Wait where messages come faster than they may; what is not read yet waits at the sender's."""
        now_ns = self._clock.now_ns()
        gained = (now_ns - self._counted_ns) / _NS * LOOKERS_MESSAGES_PER_S
        self._left, self._counted_ns = min(self._left + gained, LOOKERS_MESSAGES_PER_S) - 1.0, now_ns
        if self._left < 0.0:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(-self._left / LOOKERS_MESSAGES_PER_S):
                    await self._connection.wait_closed()


def _only_a_value(updates: object) -> bool:
    if not isinstance(updates, dict) or set(updates) != {"value"}:
        return False
    match updates["value"]:
        case bool() | int():
            return True
        case float() as number:
            return math.isfinite(number)
        case str() as text:
            return len(text) <= _LONGEST_TEXT
        case _:
            return False


def _same_place(origin: str, host: str) -> bool:
    """Whether a page's origin is where it wants to go; the names of this machine are the same to a person."""
    try:
        parts = urlsplit(origin)
    except ValueError:
        return False
    if parts.scheme != "http":
        return False
    there, here = parts.netloc.lower(), host.lower()
    return there == here or (_port_of(there) == _port_of(here) and _is_loopback(there) and _is_loopback(here))


def _is_loopback(host: str) -> bool:
    name = _name_of(host)
    with contextlib.suppress(ValueError):
        return ipaddress.ip_address(name).is_loopback
    return name == "localhost"


def _name_of(host: str) -> str:
    name = host.rpartition("]")[0].lstrip("[") if host.startswith("[") else host.partition(":")[0]
    return name.lower().rstrip(".")


def _port_of(host: str) -> str:
    return host.rpartition("]")[2].rpartition(":")[2] if ":" in host.rpartition("]")[2] else "80"
