"""The blocking shell: one socket, one thread."""

from types import TracebackType
from typing import Self

from hil.client._machine import DatagramSocket
from hil.client.fri._shell import ClientShell, cannot_answer, not_open, open_socket, timeouts
from hil.values.fri import MAX_DATAGRAM_BYTES
from hil.values.link import Address


class FriClient(ClientShell):
    """An FRI client; the socket is open inside its ``with`` block.

    ``port`` 0 takes any free one. Given a ``controller`` (``HOST[:PORT]``, default: the client's own port number), it
    hears that one only; else it answers whoever sent the last message.
    """

    _socket: DatagramSocket | None = None

    def __enter__(self) -> Self:
        """Bind; raise :class:`hil.values.errors.EndpointError` when the port is taken."""
        self.close()
        self._socket = open_socket(bind=self._bind, controller=self._controller)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    @property
    def local(self) -> Address:
        """Where the client is bound."""
        return Address(*self._open().getsockname())

    def step(self, timeout_s: float | None = None) -> bool:
        """Take one datagram and answer it; return False when none came within ``timeout_s`` seconds.

        It also returns False, early, when the controller's machine reports that nobody listens there.
        """
        sock = self._open()
        sock.settimeout(timeout_s)
        try:
            datagram, controller = sock.recvfrom(MAX_DATAGRAM_BYTES + 1)
        except (TimeoutError, ConnectionRefusedError):
            return False
        answer = self.session.receive(datagram)
        if answer is not None:
            self._answer(sock, answer, controller)
        return True

    def run(self, duration_s: float | None = None, silence_s: float | None = None) -> None:
        """Answer until the controller closes the session, ``duration_s`` is over or no message came for ``silence_s``.

        Both in seconds, None for no limit. Ctrl-C ends it with ``KeyboardInterrupt``.
        """
        for timeout_s in timeouts(self.session, duration_s=duration_s, silence_s=silence_s):
            self.step(timeout_s)

    def close(self) -> None:
        """Close the socket; does nothing when it is closed."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _open(self) -> DatagramSocket:
        if self._socket is None:
            raise not_open()
        return self._socket

    def _answer(self, sock: DatagramSocket, answer: bytes, controller: tuple[str, int]) -> None:
        while True:
            try:
                # Linux takes the address on a connected socket too; it is the one that socket is connected to.
                sock.sendto(answer, controller)
            except ConnectionRefusedError:
                # Reports an earlier answer, and this one is not sent. The report is gone now: send it again.
                continue
            except OSError as error:
                raise cannot_answer(Address(*controller), error) from error
            return
