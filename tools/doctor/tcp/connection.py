"""Connections to a peer that may be anything: every wait is bounded, every failure a sentence."""

import socket
import threading
from collections.abc import Callable
from typing import NamedTuple, Self

from hil.clock import Deadline, elapsed_ns
from hil.values.errors import EndpointError, HilError, PeerError
from hil.values.link import Address
from transport.tcp import Greeting, NotTheProbe, ProbeRefused, Reply, ReplyReader, Request, read_greeting
from transport.tcp.sockets import Kernel, kernel_facts, parse_tcp_address, set_no_delay

_READ_BYTES = 4096
RESPONDER = "the responder of hil run --tcp-probe"


class Trip(NamedTuple):
    """When things happened in one round trip, in ns of :func:`elapsed_ns`."""

    began_ns: int
    wrote_last_ns: int
    first_byte_ns: int
    complete_ns: int


def find_address(text: str, *, timeout_s: float) -> Address:
    """Return ``HOST:PORT`` resolved; raise :class:`ConfigurationError`, or EndpointError where nobody answers that."""
    parse_tcp_address(text, resolve=False)
    found: list[Address | HilError] = []

    def look() -> None:
        try:
            found.append(parse_tcp_address(text))
        except HilError as error:
            found.append(error)

    # A resolver that nobody answers keeps its caller for half a minute, and cannot be interrupted.
    thread = threading.Thread(target=look, name="hil doctor resolver", daemon=True)
    thread.start()
    thread.join(timeout_s)
    if not found:
        raise EndpointError(f"{text!r}: the name service did not answer within {timeout_s:g} s; give the address")
    if isinstance(found[0], HilError):
        raise found[0]
    return found[0]


class Connection:
    """One open connection. A context manager; :attr:`connect_ms` is what the handshake took."""

    def __init__(self, address: Address, *, timeout_s: float) -> None:
        self._address = address
        self._timeout_s = timeout_s
        began_ns = elapsed_ns()
        try:
            self._socket = socket.create_connection(address, timeout=timeout_s)
        except TimeoutError:
            raise EndpointError(
                f"{address} did not answer within {timeout_s:g} s: there is no such machine, it is not reachable from "
                "here, or something drops what is sent to that port"
            ) from None
        except ConnectionRefusedError:
            raise EndpointError(
                f"nothing listens at TCP {address}: start {RESPONDER} ADDR:PORT there, or correct the port"
            ) from None
        except OSError as error:
            raise EndpointError(f"cannot connect to TCP {address}: {error.strerror or error}") from error
        self.connect_ms = (elapsed_ns() - began_ns) * 1e-6

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    @property
    def local_host(self) -> str:
        """This side's address of the connection."""
        host: str = self._socket.getsockname()[0]
        return host

    def kernel(self) -> Kernel | None:
        """Return what the kernel here knows of it."""
        return kernel_facts(self._socket)

    def set_no_delay(self, on: bool) -> None:
        """Switch Nagle's algorithm here off (``on``) or on."""
        set_no_delay(self._socket, on)

    def greeting(self) -> Greeting:
        """Return what a responder says first; raise :class:`PeerError` for whoever is none."""
        deadline = Deadline(self._timeout_s)
        data = b""
        while True:
            try:
                part = self._receive(deadline)
            except TimeoutError:
                said = "says nothing" if not data else "stops in the middle of its first line"
                raise PeerError(
                    f"{self._address} accepts connections (in {self.connect_ms:.2f} ms) and {said} for "
                    f"{self._timeout_s:g} s: it is not {RESPONDER}, which speaks first; an echo server can be measured "
                    "with --echo"
                ) from None
            if not part:
                after = "at once" if not data else "in the middle of its first line"
                raise PeerError(f"{self._address} accepts connections and closes them {after}: it is not {RESPONDER}")
            data += part
            try:
                greeting = read_greeting(data)
            except NotTheProbe as error:
                raise PeerError(f"{self._address} speaks, but it is not {RESPONDER}: {error}") from None
            except ProbeRefused as error:
                raise PeerError(f"{self._address} refuses to be measured: {error}") from None
            if greeting is not None:
                return greeting

    def ask(self, request: Request, *, writes: int) -> tuple[Reply, Trip]:
        """Send a request in so many writes and wait for its reply; raise :class:`PeerError`."""
        reader = ReplyReader(request)
        reply: Reply | None = None

        def take(data: bytes) -> bool:
            nonlocal reply
            try:
                reply = reader.feed(data)
            except NotTheProbe as error:
                raise PeerError(f"{self._address} answered what is no answer: {error}") from None
            except ProbeRefused as error:
                raise PeerError(f"{self._address} ended the measurement: {error}") from None
            return reply is not None

        head, body = request.pack()
        trip = self._round_trip((head, body) if writes == 2 else (head + body,), take)
        if reply is None:
            raise PeerError(f"{self._address} did not answer")
        return reply, trip

    def echo(self, parts: tuple[bytes, ...]) -> Trip:
        """Send ``parts`` and wait until all of it came back; raise :class:`PeerError` where something else does."""
        wanted = b"".join(parts)
        came = bytearray()

        def take(data: bytes) -> bool:
            came.extend(data)
            if not wanted.startswith(bytes(came)):
                raise PeerError(f"{self._address} sends back something else than it was sent: it is no echo server")
            return len(came) == len(wanted)

        return self._round_trip(parts, take)

    def _round_trip(self, parts: tuple[bytes, ...], take: Callable[[bytes], bool]) -> Trip:
        deadline = Deadline(self._timeout_s)
        self._socket.settimeout(self._timeout_s)
        first_byte_ns = 0
        began_ns = elapsed_ns()
        try:
            for part in parts:
                self._socket.sendall(part)
            wrote_last_ns = elapsed_ns()
            while True:
                data = self._receive(deadline)
                now_ns = elapsed_ns()
                first_byte_ns = first_byte_ns or now_ns
                if not data:
                    raise PeerError(f"{self._address} closed the connection instead of answering")
                if take(data):
                    return Trip(began_ns, wrote_last_ns, first_byte_ns, now_ns)
        except TimeoutError:
            raise PeerError(
                f"{self._address} did not answer {sum(map(len, parts))} bytes within {self._timeout_s:g} s"
            ) from None
        except OSError as error:
            raise PeerError(f"{self._address} broke the connection: {error.strerror or error}") from error

    def _receive(self, deadline: Deadline) -> bytes:
        left_s = deadline.left_s()
        if left_s is not None and left_s <= 0.0:
            raise TimeoutError
        self._socket.settimeout(left_s)
        try:
            return self._socket.recv(_READ_BYTES)
        except ConnectionError:
            return b""
