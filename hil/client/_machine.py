"""What the clients of this process need of the machine they run on: sockets, a pump, random numbers.

An application is tested in virtual time as it is, unmodified. So the clients ask here before they open a socket, and
:mod:`hil.testkit` lays a virtual machine under them with :func:`using` while its fixture is active. Nothing else does.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

from hil.values.link import Address

if TYPE_CHECKING:
    from hil.client.servo._link import Link
    from hil.client.servo._pump import ServoPump


class DatagramSocket(Protocol):
    """What the clients use of a UDP socket; the machine's own has it all."""

    def settimeout(self, timeout_s: float | None, /) -> None:
        """Wait at most so long in ``recvfrom``; None: for ever."""

    def setblocking(self, blocks: bool, /) -> None:
        """Wait for ever, or not at all."""

    def recvfrom(self, most_bytes: int, /) -> tuple[bytes, Any]:
        """Return the next datagram and its sender; raise TimeoutError."""

    def send(self, datagram: bytes, /) -> int:
        """Send a datagram to where it is connected to."""

    def sendto(self, datagram: bytes, address: Any, /) -> int:
        """Send a datagram."""

    def getsockname(self) -> Any:
        """Return host and port it is bound to."""

    def close(self) -> None:
        """Close it."""


class Machine(Protocol):
    """Stands for the machine, its network and its time."""

    def bind(self, address: Address, *, controller: str | None) -> DatagramSocket:
        """Return what an FRI client talks through; see :func:`hil.client.fri._shell.open_socket`."""

    def connect(self, controller: Address) -> DatagramSocket:
        """Return what an asyncio servo client talks through."""

    def pump(self, link: "Link", controller: Address) -> "ServoPump":
        """Return what runs the operations of a blocking servo client."""

    def random_bits(self, count: int) -> int:
        """Return a number of ``count`` bits that nobody guesses; here it need only be another one each time."""


_virtual: Machine | None = None


def virtual_machine() -> Machine | None:
    """Return the machine that stands for the real one; None, as a rule: there is none."""
    return _virtual


@contextmanager
def using(machine: Machine) -> Iterator[None]:
    """Let the clients of this process that open inside the block live on ``machine``."""
    global _virtual  # noqa: PLW0603  # one machine for the process is what it is for
    before, _virtual = _virtual, machine
    try:
        yield
    finally:
        _virtual = before
