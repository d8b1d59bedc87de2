"""A client of a libfranka robot server over TCP and UDP; it needs nothing but Python."""

import socket
from typing import Final, Self

from tools.bench.peers import franka_wire
from tools.bench.peers.sine import with_sine

PATIENCE_S: Final = 10.0
_LONGEST_BYTES: Final = 1 << 16
_MOVE: Final = 2


class FrankaClient:
    """Connects, and answers each state with a joint position once :meth:`move` was asked for. Use it as a context."""

    def __init__(self, host: str) -> None:
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._udp.settimeout(PATIENCE_S)
        self._udp.bind(("0.0.0.0", 0))  # noqa: S104  # the server sends to the address the TCP connection comes from
        self._tcp = socket.create_connection((host, franka_wire.COMMAND_PORT), timeout=PATIENCE_S)
        self._tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._tcp.sendall(franka_wire.connect_request(self._udp.getsockname()[1]))
        self._received = b""
        self._start_rad: tuple[float, ...] | None = None
        self._cycles = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._tcp.close()
        self._udp.close()

    def receive(self) -> tuple[bytes, tuple[str, int]]:
        """Return the next state packet and its sender; raise :class:`TimeoutError`."""
        return self._udp.recvfrom(_LONGEST_BYTES)

    def ask_to_move(self) -> None:
        """Ask for a motion by joint positions."""
        self._tcp.sendall(franka_wire.move_request(_MOVE))

    def has_begun_to_move(self) -> bool:
        """Read what came over TCP; return whether the server began the motion. Does not wait."""
        self._tcp.setblocking(False)
        try:
            self._received += self._tcp.recv(_LONGEST_BYTES)
        except BlockingIOError:
            return False
        finally:
            self._tcp.settimeout(PATIENCE_S)
        while (found := franka_wire.read_answer(self._received)) is not None:
            answer, self._received = found
            if answer == franka_wire.Answer(_MOVE, franka_wire.MOTION_STARTED):
                return True
        return False

    def answer(self, state: bytes, sender: tuple[str, int]) -> None:
        """Send the next joint position of the sine; the sine begins where the arm stands."""
        if self._start_rad is None:
            self._start_rad = franka_wire.measured_position_rad(state)
        self._cycles += 1
        self.send(franka_wire.position_answer(state, with_sine(self._start_rad, self._cycles)), sender)

    def send(self, command: bytes, server: tuple[str, int]) -> None:
        """Send a command to where the states come from."""
        self._udp.sendto(command, server)
