"""Peers of a virtual controller that are no program: a handler, or one side of a recorded conversation."""

from abc import ABC, abstractmethod
from typing import Generic, Protocol, TypeVar

from hil.replay.stand_in_application import RecordedApplication
from hil.testkit._sockets import VirtualSocket
from hil.testkit._world import World


class Answering(Protocol):
    """Answers monitoring messages."""

    def receive(self, datagram: bytes) -> bytes | None:
        """Take one, and return the answer to it, if there is one."""


_Session = TypeVar("_Session")
_Answering = TypeVar("_Answering", bound=Answering)


class _Attached(ABC, Generic[_Session]):
    """A socket that the world serves; ``session`` counts what it heard and said."""

    def __init__(self, world: World, session: _Session, sock: VirtualSocket) -> None:
        self.session = session
        self._world = world
        self._socket = sock
        world.serve(self._serve)

    def detach(self) -> None:
        """Fall silent, as a program that was killed."""
        if not self._socket.closed:
            self._world.leave(self._serve)
            self._socket.close()

    @abstractmethod
    def _serve(self) -> None:
        """Take what has come, and send what is due; called after everything that happens."""


class AttachedFri(_Attached[_Answering]):
    """An FRI client that is nothing but its ``session``."""

    _answering = False

    def _serve(self) -> None:
        if self._answering:
            # The handler waits inside its callback: nobody reads meanwhile.
            return
        self._answering = True
        try:
            while (datagram := self._socket.take()) is not None:
                answer = self.session.receive(datagram)
                if answer is not None and not self._socket.closed:
                    self._socket.send(answer)
        finally:
            self._answering = False


class AttachedApplication(_Attached[RecordedApplication]):
    """A recorded application of the servo link."""

    def _serve(self) -> None:
        while (datagram := self._socket.take()) is not None:
            self.session.receive(datagram, now_ns=self._world.now_ns)
        for packet in self.session.due(now_ns=self._world.now_ns):
            self._socket.send(packet)
