"""The pump of a blocking servo client in virtual time: its waits let time pass, and no thread is needed.

In between two calls the client's own thread would keep the session alive and tell goals reached. Here the world calls
:meth:`VirtualPump.serve` after everything that happens, which does the same.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from hil.client.servo._link import FAREWELLS, Link
from hil.client.servo._operations import Operation, Wait
from hil.testkit._sockets import POLL_NS, VirtualSocket, whole_ns

if TYPE_CHECKING:
    from hil.testkit._world import World

_T = TypeVar("_T")


class VirtualPump:
    """Runs operations over ``sock``, which is this object's from now on."""

    def __init__(self, world: "World", link: Link, sock: VirtualSocket) -> None:
        self.link = link
        self._world = world
        self._socket = sock
        self._until: Callable[[], bool] | None = None
        """What the call that waits is waiting for."""
        self._telling = False
        world.serve(self.serve)

    def start(self) -> None:
        """Nothing: it works between calls already."""

    def run(self, operation: Operation[_T], /) -> _T:
        """Run an operation and return its result."""
        came: bool | None = None
        try:
            self.link.raise_kept()
            while True:
                wait = next(operation) if came is None else operation.send(came)
                came = self._wait(wait)
        except StopIteration as stop:
            result: _T = stop.value
            return result
        finally:
            operation.close()

    def look(self) -> None:
        """Take in what has come; looking takes a moment."""
        self.link.raise_kept()
        self._world.pass_ns(POLL_NS)
        self.serve()

    def close(self) -> None:
        """Say goodbye, end the session, release everything."""
        for _ in range(FAREWELLS):
            if (datagram := self.link.session.goodbye()) is not None:
                self._socket.send(datagram)
        self.link.session.end("the application closed it")
        self._world.leave(self.serve)
        self._socket.close()

    def serve(self) -> None:
        """Take in what has come, send what there is to say, tell goals reached."""
        link = self.link
        came = False
        while (datagram := self._socket.take()) is not None:
            link.take(datagram)
            came = True
        if not came and link.patience_s() <= 0.0:
            link.nothing_came()
        # Who got what it waits for may have something to say in a moment, and then both travel together.
        if (self._until is None or not self._until()) and (said := link.outgoing()) is not None:
            self._socket.send(said)
        if link.goals_to_tell and not self._telling:
            self._telling = True
            try:
                link.tell_goals()
            finally:
                self._telling = False

    def _wait(self, wait: Wait) -> bool:
        until_ns = None if wait.timeout_s is None else self._world.now_ns + whole_ns(wait.timeout_s)
        before, self._until = self._until, wait.until
        try:
            self.serve()
            return self._world.wait(wait.until, until_ns=until_ns)
        finally:
            self._until = before
