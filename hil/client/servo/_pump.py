"""One socket for the threads of a blocking client.

The calling thread sends and receives while it waits, so no thread has to wake another for it. One thread at a time
reads; other callers wait for its news. Between calls the client's own thread reads, keeps the session alive and tells
goals reached: it steps aside when a caller comes, and comes back a moment after the last one left.
"""

import selectors
import socket
import threading
from contextlib import suppress
from typing import Final, Protocol, TypeVar

from hil.client._machine import virtual_machine
from hil.client.servo._link import FAREWELLS, Link, open_socket
from hil.client.servo._operations import Operation, Wait
from hil.clock import Deadline
from hil.values.link import Address
from hil.values.servo import MAX_SERVO_DATAGRAM_BYTES

_REST_S: Final = 0.005
"""Without calls for so long, the client's own thread reads again."""
_MOST_AT_ONCE: Final = 64
"""Datagrams read before anybody looks at them."""
_LEAVE_S: Final = 1.0
"""How long closing waits for other threads to leave their calls."""

_T = TypeVar("_T")


class ServoPump(Protocol):
    """What a blocking client needs of a pump."""

    @property
    def link(self) -> Link:
        """The session, and what the clock has to do with it."""

    def start(self) -> None:
        """Let the client work between calls."""

    def run(self, operation: Operation[_T], /) -> _T:
        """Run an operation in the calling thread and return its result."""

    def look(self) -> None:
        """Take in what has come."""

    def close(self) -> None:
        """Say goodbye, end the session, release everything."""


def open_pump(link: Link, controller: Address) -> ServoPump:
    """Return the pump of a client of ``controller``; raise :class:`EndpointError`."""
    machine = virtual_machine()
    return Pump(link, open_socket(controller)) if machine is None else machine.pump(link, controller)


class Pump:
    """Runs operations for any thread over ``sock``, which does not block and is this object's from now on."""

    def __init__(self, link: Link, sock: socket.socket) -> None:
        self.link = link
        self._socket = sock
        self._lock = threading.Lock()
        self._news = threading.Condition(self._lock)
        self._own_turn = threading.Condition(self._lock)
        self._callers: set[int] = set()
        self._calls = 0
        self._calls_noted = 0
        self._reading = False
        self._own_thread_reads = False
        self._closing = False
        self._woken = False
        self._wake_in, self._wake_out = socket.socketpair()
        self._selector = selectors.DefaultSelector()
        for readable in (self._socket, self._wake_in):
            readable.setblocking(False)
            self._selector.register(readable, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._serve, name="hil servo client", daemon=True)

    def start(self) -> None:
        """Let the client's own thread work between calls."""
        self._thread.start()

    def run(self, operation: Operation[_T]) -> _T:
        """Run an operation in the calling thread and return its result."""
        caller = threading.get_ident()
        try:
            with self._lock:
                self._callers.add(caller)
                self._calls += 1
                self.link.raise_kept()
            return self._drive(operation)
        finally:
            operation.close()
            with self._lock:
                self._callers.discard(caller)
                self._news.notify_all()

    def look(self) -> None:
        """Take in what has come, unless another thread is at it."""
        with self._lock:
            self.link.raise_kept()
            if not self._reading:
                self._take_in()

    def close(self) -> None:
        """Say goodbye, end the session, wait for the threads, close the socket."""
        with self._lock:
            for _ in range(FAREWELLS):
                self._send(self.link.session.goodbye())
            self.link.session.end("the application closed it")
            self._closing = True
            self._wake()
            self._news.notify_all()
            self._own_turn.notify_all()
        try:
            own = threading.current_thread() is self._thread
            if self._thread.is_alive() and not own:
                self._thread.join()
            with self._lock:
                self._news.wait_for(lambda: self._callers <= {threading.get_ident()}, timeout=_LEAVE_S)
        finally:
            self._selector.close()
            for sock in (self._socket, self._wake_in, self._wake_out):
                sock.close()

    def _drive(self, operation: Operation[_T]) -> _T:
        came: bool | None = None
        while True:
            with self._lock:
                try:
                    wait = next(operation) if came is None else operation.send(came)
                except StopIteration as stop:
                    result: _T = stop.value
                    return result
            came = self._wait(wait)

    def _wait(self, wait: Wait) -> bool:
        deadline = Deadline(wait.timeout_s)
        caught_up = False
        while True:
            reading = False
            try:
                with self._lock:
                    left_s = deadline.left_s()
                    if wait.until():
                        return True
                    if left_s is not None and left_s <= 0.0:
                        return False
                    if not caught_up:
                        caught_up = True
                        if self._catch_up():
                            continue
                    self._flush()
                    if self._reading:
                        if self._own_thread_reads:
                            self._wake()
                        self._news.wait(left_s)
                        continue
                    reading = self._reading = True
                    patience_s = self.link.patience_s()
                self._selector.select(patience_s if left_s is None else min(patience_s, left_s))
            finally:
                if reading:
                    self._reading = False
            with self._lock:
                self._take_in()

    def _serve(self) -> None:
        try:
            while not self._closing:
                self._turn()
        except BaseException as error:  # whatever it is, callers must not wait for this thread
            with self._lock:
                self.link.session.end(f"the client's own thread failed: {error!r}")
                self._news.notify_all()
            raise

    def _turn(self) -> None:
        """One turn of the client's own thread: read, or leave that to the callers for a moment."""
        link = self.link
        with self._lock:
            self._flush()
            called = self._calls != self._calls_noted
            self._calls_noted = self._calls
            mine = not (called or self._callers or self._reading or self._closing or link.session.over)
            if mine:
                self._reading = self._own_thread_reads = True
            elif not (link.goals_to_tell or self._closing):
                self._own_turn.wait(None if link.session.over else min(_REST_S, link.patience_s()))
            patience_s = link.patience_s()
        if mine:
            try:
                self._selector.select(patience_s)
            finally:
                self._reading = self._own_thread_reads = False
            with self._lock:
                self._take_in()
        link.tell_goals()

    def _take_in(self) -> None:
        """Take in what has come, and let everybody look at it. Needs the lock."""
        if self._woken:
            self._woken = False
            self._wake_in.recv(1)
        if not self._take_waiting():
            self.link.nothing_came()
        self._tell_news()

    def _catch_up(self) -> bool:
        """Take in what has come, so that what is sent next reflects the newest state; return whether there was some.

        The controller drops what reflects an old one, and between calls nobody reads for a moment. Needs the lock.
        """
        if not self._take_waiting():
            return False
        self._tell_news()
        if self._reading:
            # What that thread waits for may have come in here.
            self._wake()
        return True

    def _take_waiting(self) -> int:
        """Take in what has come and return how many datagrams that were. Needs the lock."""
        came = 0
        while came < _MOST_AT_ONCE and (datagram := self._receive()) is not None:
            self.link.take(datagram)
            came += 1
        return came

    def _tell_news(self) -> None:
        self._news.notify_all()
        if self.link.goals_to_tell:
            self._own_turn.notify()

    def _flush(self) -> None:
        self._send(self.link.outgoing())

    def _wake(self) -> None:
        """Make the thread that reads look up from the socket. Needs the lock."""
        if not self._woken:
            self._woken = True
            self._wake_out.send(b"\0")

    def _receive(self) -> bytes | None:
        try:
            return self._socket.recv(MAX_SERVO_DATAGRAM_BYTES + 1)
        except BlockingIOError:
            return None
        except OSError as error:
            # Reports what became of a packet sent earlier: nobody listens there, mostly.
            self.link.session.trouble = str(error.strerror)
            return None

    def _send(self, datagram: bytes | None) -> None:
        """Send; what cannot be sent is lost, like what gets lost on the way: the session carries it again."""
        if datagram is None:
            return
        try:
            self._socket.send(datagram)
        except ConnectionRefusedError as error:
            # Reports an earlier packet, and this one is not sent. The report is gone now: send it again.
            self.link.session.trouble = str(error.strerror)
            with suppress(OSError):
                self._socket.send(datagram)
        except OSError as error:
            self.link.session.trouble = str(error.strerror)
