"""UDP endpoints: for one peer, and for any number of peers.

For one peer there is a connected socket, and a second one that hears everybody else. The connected socket is the
kernel's filter: only the peer's datagrams reach it. What other senders address to the same port would be refused
unseen; the second, unconnected socket on the same address takes those, so that they can be counted. For any number of
peers there is one unconnected socket. They are read one datagram a pass of the event loop, that for many peers a few
more, because a busy loop would else fall behind what its peers send; nothing queues here but what the kernel holds.
"""

import asyncio
import errno
import socket
import struct
import sys
from collections.abc import Callable
from typing import NamedTuple

import asyncio_dgram

from hil.values.errors import ConfigurationError, EndpointError
from hil.values.link import Address
from transport.holders import held_by

ANY_HOST = "0.0.0.0"  # noqa: S104  # compared with, never bound to by default
RECEIVE_BUFFER_BYTES = 1 << 18
SERVER_DATAGRAMS_AT_ONCE = 8
"""Read in one pass of the event loop from a socket for many peers. More would let a flood hold up a control cycle."""
MOST_UNTAKEN = 256
"""Datagrams that were read from a socket and that nobody took yet; those that come then are dropped and counted."""
_LONGEST_DATAGRAM_BYTES = 1 << 16
_SIOCGSTAMPNS = 0x8907
_TIMESPEC = struct.Struct("@ll")
_IP_RECVERR = 11
_MOST_ERRORS_AT_ONCE = 1024
_IN_USE = (
    "; another program holds that port, and one that listens on all addresses (an FRI client does) holds "
    "it on every address of this machine: choose another port, bind the client to one address, "
    "or give it a network namespace of its own"
)
_SERVED = "; another `hil run` may serve there: choose another address with --servo ADDR:PORT"


class Arrival(NamedTuple):
    """A datagram, who sent it, and when the kernel got it in Unix time; None where the kernel does not say."""

    datagram: bytes
    sender: Address
    at_unix_ns: int | None


class EndpointClosed(EndpointError):
    """The endpoint was closed while somebody waited for a datagram."""


class _Channel:
    """One socket that asyncio reads, and what the kernel tells of it. Make it with :func:`_open_channel`."""

    def __init__(self, sock: socket.socket, *, at_once: int) -> None:
        self.local = Address(*sock.getsockname())
        self.refused = 0
        self.untaken = 0
        self._socket = sock
        self._at_once = at_once
        self._stream: asyncio_dgram.aio.DatagramStream | None = None
        """None before it is open, and when it is closed."""

    async def open(self) -> None:
        """Let asyncio read the socket."""
        self._stream = await _stream(
            self._socket, at_once=self._at_once, on_error=self._told_error, on_full=self._told_full
        )

    def close(self) -> None:
        """Close the socket; whoever waits for a datagram gets :class:`EndpointClosed`."""
        if self._stream is not None:
            self._stream.close()
            self._stream = None

    async def send(self, datagram: bytes, *destination: Address) -> None:
        """Send to ``destination``, or to the peer of a connected socket."""
        if self._stream is None:
            raise EndpointClosed(f"{self.local} is closed")
        # A pending ICMP error would make the kernel refuse this datagram instead of sending it: fetch it first.
        if self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            self._told_error()
        try:
            await self._stream.send(datagram, *destination)
        except asyncio_dgram.TransportClosed:
            raise EndpointClosed(f"{self.local} is closed") from None

    async def receive(self) -> Arrival:
        """Return the next datagram; raise :class:`EndpointClosed`."""
        if self._stream is None:
            raise EndpointClosed(f"{self.local} is closed")
        try:
            datagram, (sender, at_unix_ns) = await self._stream.recv()
        except (asyncio_dgram.TransportClosed, OSError) as error:
            raise EndpointClosed(f"{self.local} is closed") from error
        return Arrival(datagram, Address(*sender[:2]), at_unix_ns)

    def _told_error(self) -> None:
        self.refused += max(1, _discard_answers(self._socket))

    def _told_full(self) -> None:
        self.untaken += 1


class PeerEndpoint:
    """A bound address that talks to one peer. Make it with :func:`open_peer_endpoint`; ``close`` is idempotent."""

    def __init__(self, *, peer: Address, connected: _Channel, others: _Channel) -> None:
        self.local = connected.local
        self.peer = peer
        self._connected = connected
        self._others = others

    @property
    def refused(self) -> int:
        """Datagrams the peer's machine answered with "nobody listens there", and those that found no way to it."""
        return self._connected.refused

    @property
    def untaken(self) -> int:
        """Datagrams that were dropped because too many came before somebody took them."""
        return self._connected.untaken + self._others.untaken

    async def send(self, datagram: bytes) -> None:
        """Send to the peer. That nobody listens there is counted, not raised."""
        await self._connected.send(datagram)

    async def receive(self) -> Arrival:
        """Return the peer's next datagram; raise :class:`EndpointClosed`."""
        return await self._connected.receive()

    async def receive_stranger(self) -> Arrival:
        """Return the next datagram of anybody else; raise :class:`EndpointClosed`."""
        return await self._others.receive()

    def close(self) -> None:
        """Close both sockets."""
        self._connected.close()
        self._others.close()


class ServerEndpoint:
    """A bound address for any number of peers. Make it with :func:`open_server_endpoint`; ``close`` is idempotent."""

    def __init__(self, channel: _Channel) -> None:
        self.local = channel.local
        self._channel = channel

    @property
    def refused(self) -> int:
        """Datagrams that were answered with "nobody listens there", and those that found no way."""
        return self._channel.refused

    @property
    def untaken(self) -> int:
        """Datagrams that were dropped because too many came before somebody took them."""
        return self._channel.untaken

    async def send(self, datagram: bytes, destination: Address) -> None:
        """Send to ``destination``. That it cannot be reached is counted, not raised."""
        await self._channel.send(datagram, destination)

    async def receive(self) -> Arrival:
        """Return the next datagram of anybody; raise :class:`EndpointClosed`."""
        return await self._channel.receive()

    def close(self) -> None:
        """Close the socket."""
        self._channel.close()


async def open_peer_endpoint(*, bind: Address, peer: Address) -> PeerEndpoint:
    """Bind ``bind`` (port 0: any free one) for ``peer``; raise :class:`EndpointError` in one sentence."""
    refuse_shared_port(bind=bind, peer=peer)
    first = _socket()
    second = _socket()
    try:
        # Bound without SO_REUSEADDR, so that a port in use is found out; the option then lets in our second socket,
        # and is taken back before anybody else could use it.
        bind_socket(first, bind, in_use=_IN_USE)
        bound = first.getsockname()
        first.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        second.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bind_socket(second, Address(*bound), in_use=_IN_USE)
        for sock in (first, second):
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 0)
            sock.setblocking(False)
        _connect(first, peer)
        connected = await _open_channel(first)
        try:
            others = await _open_channel(second)
        except BaseException:
            # Not only its socket: the event loop would go on looking at it.
            connected.close()
            raise
    except BaseException:
        first.close()
        second.close()
        raise
    return PeerEndpoint(peer=peer, connected=connected, others=others)


async def open_server_endpoint(bind: Address, *, in_use: str = _SERVED) -> ServerEndpoint:
    """Bind ``bind`` (port 0: any free one) for whoever sends; raise :class:`EndpointError` in one sentence.

    The sentence has ``in_use`` in it where the port is taken, and by whom as far as that can be known.
    """
    sock = _socket()
    try:
        bind_socket(sock, bind, in_use=in_use)
        sock.setblocking(False)
        if sys.platform == "linux":
            # Without it an unconnected socket is not told that nobody listens where it sends to.
            sock.setsockopt(socket.IPPROTO_IP, _IP_RECVERR, 1)
        return ServerEndpoint(await _open_channel(sock, at_once=SERVER_DATAGRAMS_AT_ONCE))
    except BaseException:
        sock.close()
        raise


async def _open_channel(sock: socket.socket, *, at_once: int = 1) -> _Channel:
    channel = _Channel(sock, at_once=1 if sys.platform == "win32" else at_once)
    await channel.open()
    return channel


class _Protocol(asyncio_dgram.aio.Protocol):  # type: ignore[misc]  # asyncio-dgram has no types
    """asyncio-dgram's protocol, which also asks the kernel when it got the datagram that was just read.

    A control loop that was held up for a moment reads late what came in time; only the kernel knows. Errors are told to
    ``on_error`` at once, because asyncio-dgram would queue them without a bound until somebody sends.
    """

    def __init__(
        self,
        *queues: object,
        sock: socket.socket,
        at_once: int,
        on_error: Callable[[], None],
        on_full: Callable[[], None],
    ) -> None:
        super().__init__(*queues)
        self._on_full = on_full
        self._socket = sock
        self._at_once = at_once
        self._on_error = on_error

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Queue the datagram with its sender and its time of arrival, and what else has come, as far as allowed."""
        self._put(data, addr)
        for _ in range(1, self._at_once):
            try:
                more, sender = self._socket.recvfrom(_LONGEST_DATAGRAM_BYTES)
            except BlockingIOError:
                return
            except OSError:
                self._on_error()
                return
            self._put(more, sender)

    def _put(self, data: bytes, addr: tuple[str, int]) -> None:
        # Counted here and not by the queue, which must always have room for the end.
        if self._recvq.qsize() >= MOST_UNTAKEN:
            self._on_full()
        else:
            super().datagram_received(data, (addr, _arrived_unix_ns(self._transport)))

    def error_received(self, exc: Exception) -> None:  # noqa: ARG002  # asyncio's name; the counter needs no reason
        """Tell of a datagram that did not arrive."""
        self._on_error()


async def _stream(
    sock: socket.socket, *, at_once: int, on_error: Callable[[], None], on_full: Callable[[], None]
) -> asyncio_dgram.aio.DatagramStream:
    """Return what ``asyncio_dgram.from_socket`` returns, with arrival times in the place of the address."""
    loop = asyncio.get_running_loop()
    received: asyncio.Queue[tuple[bytes, tuple[tuple[str, int], int | None]]] = asyncio.Queue()
    errors: asyncio.Queue[Exception] = asyncio.Queue()
    drained = asyncio.Event()
    transport, _ = await loop.create_datagram_endpoint(
        lambda: _Protocol(received, errors, drained, sock=sock, at_once=at_once, on_error=on_error, on_full=on_full),
        sock=sock,
    )
    # The first question makes the kernel begin to stamp; the first answers may be the time of asking.
    _arrived_unix_ns(transport)
    peer = transport.get_extra_info("peername")
    if peer is None:
        return asyncio_dgram.aio.DatagramServer(transport, received, errors, drained)
    transport._address = peer  # type: ignore[attr-defined]  # as asyncio-dgram does it
    return asyncio_dgram.aio.DatagramClient(transport, received, errors, drained)


def _discard_answers(sock: socket.socket) -> int:
    """Discard the ICMP answers the kernel keeps beside an error, and return how many.

    As long as there are any, the socket counts as readable, and the event loop would do nothing else.
    """
    answers = 0
    while sys.platform == "linux" and answers < _MOST_ERRORS_AT_ONCE:
        try:
            sock.recvmsg(0, 0, socket.MSG_ERRQUEUE)
        except OSError:
            break
        answers += 1
    return answers


def _arrived_unix_ns(transport: asyncio.DatagramTransport) -> int | None:
    if sys.platform != "linux":
        return None
    import fcntl

    try:
        answer = fcntl.ioctl(transport.get_extra_info("socket").fileno(), _SIOCGSTAMPNS, bytes(_TIMESPEC.size))
    except OSError:
        return None
    seconds, nanoseconds = _TIMESPEC.unpack(answer)
    return int(seconds) * 1_000_000_000 + int(nanoseconds)


def refuse_shared_port(*, bind: Address, peer: Address) -> None:
    """Raise :class:`ConfigurationError` where a client on this machine could not have its port beside ours."""
    if peer.port == 0:
        raise ConfigurationError(f"the client at {peer} needs a port of its own, 1..65535")
    if bind.port == 0 or bind.port != peer.port or not is_local(peer.host):
        return
    if bind.host == ANY_HOST:
        raise ConfigurationError(
            f"cannot bind {bind} for the client at {peer}: it would take the client's port {peer.port} on every "
            f"address of this machine; bind another port, or another loopback address (127.0.0.2:{peer.port})"
        )
    if bind.host == peer.host:
        raise ConfigurationError(f"cannot bind {bind}: that is the client's own address")


def is_local(host: str) -> bool:
    """Return whether ``host`` is an address of this machine."""
    with _socket() as sock:
        try:
            sock.bind((host, 0))
        except OSError:
            return False
    return True


def default_bind(peer: Address) -> Address:
    """Return where to bind for ``peer`` when nothing is said.

    The address this machine reaches the peer from; any free port for a client on this machine, which holds its own
    port here, and the client's port for one elsewhere, because a client that was given a host name hears only that.
    """
    if is_local(peer.host):
        return Address(peer.host, 0)
    with _socket() as sock:
        _connect(sock, peer)
        return Address(sock.getsockname()[0], peer.port)


def parse_address(text: str, *, default_port: int, resolve: bool = True) -> Address:
    """Return ``HOST[:PORT]`` with the host resolved to IPv4, unless told not to; raise :class:`ConfigurationError`."""
    if text.count(":") > 1:
        raise ConfigurationError(f"{text!r}: the links run over IPv4; give HOST or HOST:PORT")
    host, colon, port_text = text.partition(":")
    try:
        port = int(port_text) if colon else default_port
    except ValueError:
        port = -1
    if colon and not port_text.isdecimal():
        raise ConfigurationError(f"{text!r}: the port {port_text!r} is no number")
    if not 0 <= port <= 65535:
        raise ConfigurationError(f"{text!r}: port {port} is outside 0..65535")
    if not resolve:
        return Address(host, port)
    try:
        return Address(socket.getaddrinfo(host, None, socket.AF_INET, socket.SOCK_DGRAM)[0][4][0], port)  # type: ignore[arg-type]
    except (socket.gaierror, UnicodeError):
        raise ConfigurationError(f"{text!r}: there is no host {host!r} with an IPv4 address") from None


def bind_socket(sock: socket.socket, address: Address, *, in_use: str) -> None:
    """Bind ``sock``; raise :class:`EndpointError` in one sentence with ``in_use``, and by whom, if it is taken."""
    try:
        sock.bind(address)
    except OSError as error:
        hint = in_use + held_by("udp", address) if error.errno == errno.EADDRINUSE else ""
        raise EndpointError(f"cannot bind UDP {address}: {error.strerror}{hint}") from error


def free_port(host: str) -> int:
    """Return a UDP port of a local address that nobody uses now."""
    with _socket() as sock:
        sock.bind((host, 0))
        port: int = sock.getsockname()[1]
        return port


def _socket() -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
    return sock


def _connect(sock: socket.socket, peer: Address) -> None:
    try:
        sock.connect(peer)
    except OSError as error:
        raise EndpointError(f"cannot reach UDP {peer}: {error.strerror}") from error
