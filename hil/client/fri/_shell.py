"""What both shells share: the socket, and how long a run waits for its next datagram."""

import socket
from collections.abc import Iterator

from hil.client._machine import DatagramSocket, virtual_machine
from hil.client.fri.errors import NothingHeard
from hil.client.fri.handler import FriHandler
from hil.client.fri.session import ClientSession
from hil.clock import Deadline
from hil.values.errors import ConfigurationError, EndpointError, UsageError
from hil.values.fri import CLIENT_PORT, Release
from hil.values.link import Address
from transport.udp import ANY_HOST, bind_socket, parse_address

_IN_USE = "; another program, maybe another FRI client, holds that port: end it, or choose another port"


class ClientShell:
    """The part of a client that has no socket yet: its session, and where it will bind and connect."""

    def __init__(
        self,
        handler: FriHandler,
        *,
        release: Release,
        port: int = CLIENT_PORT,
        bind_host: str = ANY_HOST,
        controller: str | None = None,
    ) -> None:
        self.session = ClientSession(release, handler)
        self._bind = Address(bind_host, port)
        self._controller = controller


def open_socket(*, bind: Address, controller: str | None) -> DatagramSocket:
    """Return a UDP socket bound to ``bind``, connected to ``controller`` (``HOST[:PORT]``, port: ours) when given.

    Raises :class:`EndpointError` in one sentence, and leaves no socket open then.
    """
    if not 0 <= bind.port <= 65535:
        raise ConfigurationError(f"port {bind.port} is outside 0..65535")
    if (machine := virtual_machine()) is not None:
        return machine.bind(bind, controller=controller)
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        bind_socket(sock, bind, in_use=_IN_USE)
        if controller is not None:
            _connect(sock, parse_address(controller, default_port=sock.getsockname()[1]))
    except BaseException:
        sock.close()
        raise
    return sock


def timeouts(session: ClientSession, *, duration_s: float | None, silence_s: float | None) -> Iterator[float | None]:
    """Yield how long, in seconds, to wait for the next datagram (None: for ever), until the run is over.

    It is over when the session ends, after ``duration_s``, or ``silence_s`` after the last monitoring message. Raises
    :class:`NothingHeard` when it is over without one.
    """
    duration, silence = Deadline(duration_s), Deadline(silence_s)
    while True:
        left = _earlier(duration.left_s(), silence.left_s())
        if left is not None and left <= 0:
            if session.received == 0:
                raise NothingHeard(session.release, session.malformed)
            return
        received = session.received
        yield left
        if session.received != received:
            silence.restart()
            if session.ended:
                return


def not_open() -> UsageError:
    """Return the error of a client used outside its ``with`` block."""
    return UsageError("the FRI client is not open; use it inside its with block")


def cannot_answer(controller: object, error: OSError) -> EndpointError:
    """Return the error of an answer the machine would not send."""
    return EndpointError(f"cannot answer the controller at {controller}: {error.strerror}")


def _earlier(one: float | None, other: float | None) -> float | None:
    if one is None or other is None:
        return other if one is None else one
    return min(one, other)


def _connect(sock: socket.socket, controller: Address) -> None:
    try:
        sock.connect(controller)
    except OSError as error:
        raise EndpointError(f"cannot reach the controller at UDP {controller}: {error.strerror}") from error
