"""The stand-in controller on a socket, ticked each millisecond by a thread of its own."""

import gc
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TypeVar

from hil.clock import Clock, MonotonicClock
from tests.support.servo_controller import StandIn
from transport.servo import ServoCodec

HOST = "127.0.0.1"
TICK_NS = 1_000_000
PATIENCE_S = 10.0
_T = TypeVar("_T")


@dataclass
class Served:
    """A stand-in that is being served; look at it, and change it, under :meth:`do` only."""

    controller: StandIn
    sock: socket.socket
    client: tuple[str, int] | None = None
    deaf: bool = False
    """Whether it neither hears nor says anything."""
    _lock: threading.Condition = field(default_factory=threading.Condition)
    _over: bool = False
    _clock: Clock = field(default_factory=MonotonicClock)

    @property
    def address(self) -> str:
        """Where it is served."""
        return f"{HOST}:{self.sock.getsockname()[1]}"

    def do(self, action: Callable[[StandIn], _T]) -> _T:
        """Do something with the stand-in between two ticks."""
        with self._lock:
            return action(self.controller)

    def until(self, condition: Callable[[StandIn], bool]) -> None:
        """Wait until ``condition`` holds of the stand-in; fail if it does not happen."""
        with self._lock:
            assert self._lock.wait_for(lambda: condition(self.controller), PATIENCE_S)

    def serve(self) -> None:
        """Serve until :meth:`stop`."""
        due_ns = self._clock.now_ns()
        while not self._over:
            due_ns += TICK_NS
            self._receive_until(due_ns)
            with self._lock:
                self.controller.tick()
                sent = self.controller.fetch()
                self._lock.notify_all()
            if self.client is not None and not self.deaf:
                for datagram in sent:
                    self.sock.sendto(datagram, self.client)

    def stop(self) -> None:
        """Serve no longer."""
        self._over = True

    def _receive_until(self, due_ns: int) -> None:
        while (left_ns := due_ns - self._clock.now_ns()) > 0:
            self.sock.settimeout(left_ns * 1e-9)
            try:
                datagram, client = self.sock.recvfrom(2048)
            except TimeoutError:
                return
            if not self.deaf:
                self.client = client
                with self._lock:
                    self.controller.receive(datagram)


@contextmanager
def served(controller: StandIn | None = None, *, key: bytes | None = None) -> Iterator[Served]:
    """Serve a stand-in on a free port of the loopback address until the block ends.

    A socket that was forgotten inside warns at the end, in the test that forgot it.
    """
    # What there is before is not looked at again: that takes a fifth of a second each time.
    gc.freeze()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind((HOST, 0))
        served_one = Served(controller or StandIn(ServoCodec(key)), sock)
        thread = threading.Thread(target=served_one.serve, name="stand-in")
        thread.start()
        try:
            yield served_one
        finally:
            served_one.stop()
            thread.join()
    gc.collect()
    gc.unfreeze()
