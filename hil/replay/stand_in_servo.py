"""A recorded controller of the servo link that speaks to a live application: sans-I/O, times are arguments.

Its states leave when they left in the recording, counted from the application's hello, and the session is the recorded
one, token and all; a state that says a request is done waits until the application has asked for it. What the
application asks for is compared request by request with what was recorded.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

from hil.replay.fields import differences
from hil.replay.result import Moment, ReplayResult
from hil.values.errors import MalformedDatagram
from hil.values.link import Address
from hil.values.servo import Command, Ended, FromController, Goodbye, Hello, Request, State, Welcome
from transport.capture.records import Packet
from transport.servo import ServoCodec

_REMEMBERED: Final = 1024

_PATIENCE_NS: Final = 1_000_000_000
"""How long the recording stands still for a live application that is slower than the recorded one."""


class _Due(NamedTuple):
    """A datagram of the recording: when it leaves [ns since the hello], and requests it says are done."""

    at_ns: int
    datagram: bytes
    requests_done: int


class RecordedServoController:
    """Plays the controller at ``controller`` to the first application of ``packets``, which was at ``client``."""

    def __init__(
        self,
        packets: Iterator[Packet],
        *,
        client: Address,
        controller: Address,
        codec: ServoCodec,
        result: ReplayResult,
    ) -> None:
        self._codec = codec
        self._result = result
        self._route = client, controller
        self._recorded: dict[int, tuple[Request, float, int]] = {}
        """Recorded requests that no live one was compared with, by number: request, when [s], packet."""
        self._live: dict[int, Request] = {}
        """Live requests whose recorded one is still to come."""
        self._newest = 0
        """Number of the newest live request."""
        self._hello_unix_ns: int | None = None
        self._welcome: Welcome | None = None
        self._states = self._own(packets)
        self._next: _Due | None = None
        self._began_ns: int | None = None
        self._waits = False
        """Whether the recording stands still for the application."""
        self.peer: Address | None = None
        """Where the live application is; there once it said hello."""
        self.sent = self.malformed = 0
        self.left = False
        """Whether the live application said goodbye."""

    @property
    def over(self) -> bool:
        """Whether there is nothing more to say."""
        return self._began_ns is not None and self._next is None

    def next_due_ns(self) -> int | None:
        """Return when :meth:`due` has something to send next; None before a hello, and when there is no more."""
        if self._began_ns is None or self._next is None:
            return None
        due_ns = self._began_ns + self._next.at_ns
        return due_ns + _PATIENCE_NS if self._next.requests_done > self._newest else due_ns

    def due(self, *, now_ns: int) -> list[bytes]:
        """Return the datagrams that are due."""
        datagrams = []
        while self._began_ns is not None and self._next is not None and now_ns >= self._began_ns + self._next.at_ns:
            late_ns = now_ns - self._began_ns - self._next.at_ns
            if self._next.requests_done > self._newest and late_ns < _PATIENCE_NS:
                self._waits = True
                break
            if self._waits:
                self._began_ns += late_ns
                self._waits = False
            datagrams.append(self._next.datagram)
            self._result.recorded_s = self._result.reached_s = self._next.at_ns / 1e9
            self._next = next(self._states, None)
        self.sent += len(datagrams)
        return datagrams

    def receive(self, datagram: bytes, sender: Address, *, now_ns: int) -> bytes | None:
        """Take a datagram of the live application; return an answer that leaves at once."""
        try:
            packet = self._codec.decode_from_client(datagram)
        except MalformedDatagram:
            self.malformed += 1
            return None
        if isinstance(packet, Hello):
            return self._offer(packet, sender, now_ns)
        if sender != self.peer or self._welcome is None or packet.token != self._welcome.token:
            return None
        self._result.inputs += 1
        if isinstance(packet, Goodbye):
            self.left = True
        elif isinstance(packet, Command):
            for request in packet.requests:
                # Requests travel again until they are done; each is compared once.
                if request.number > self._newest:
                    self._newest = request.number
                    self._take(request)
        return None

    def finish(self) -> None:
        """The recording is over: what the application did not ask for is missing."""
        for number, (request, t_s, packet) in sorted(self._recorded.items()):
            self._result.extra += 1
            what = f"the application did not ask for {type(request).__name__} {number}"
            self._result.differ_whole(Moment("application", t_s, 0, packet), what)
        for number, request in sorted(self._live.items()):
            self._result.missing += 1
            what = f"the application asked for {type(request).__name__} {number}, which is not in the recording"
            self._result.differ_whole(Moment("application", self._result.recorded_s, 0, 0), what)

    def _offer(self, hello: Hello, sender: Address, now_ns: int) -> bytes | None:
        if self._began_ns is None:
            self._next = next(self._states, None)
            self._began_ns = now_ns
            self.peer = sender
        if sender != self.peer or self._welcome is None:
            return None
        self.sent += 1
        return self._codec.encode_from_controller(self._welcome._replace(nonce=hello.nonce))

    def _take(self, request: Request) -> None:
        recorded = self._recorded.pop(request.number, None)
        if recorded is not None:
            self._compare(request, *recorded)
        elif len(self._live) < _REMEMBERED:
            self._live[request.number] = request

    def _compare(self, live: Request, recorded: Request, t_s: float, packet: int) -> None:
        self._result.compared += 1
        found = list(differences(recorded, live))
        if found:
            self._result.differ(Moment("application", t_s, 0, packet), found)
        else:
            self._result.identical += 1

    def _own(self, packets: Iterator[Packet]) -> Iterator[_Due]:
        client, controller = self._route
        for packet in packets:
            route = Address(*packet.source), Address(*packet.destination)
            try:
                if route == (client, controller):
                    self._expect(packet)
                elif route == (controller, client) and self._hello_unix_ns is not None:
                    value = self._codec.decode_from_controller(packet.payload)
                    if self._belongs(value):
                        done = value.requests_done if isinstance(value, State) else 0
                        yield _Due(packet.at_unix_ns - self._hello_unix_ns, packet.payload, done)
            except MalformedDatagram:
                continue

    def _belongs(self, value: FromController) -> bool:
        """Whether a recorded packet is to be said again: what the first session was told, but for its welcome."""
        if isinstance(value, Welcome):
            self._welcome = self._welcome or value
            return False
        return isinstance(value, State | Ended) and self._welcome is not None and value.token == self._welcome.token

    def _expect(self, packet: Packet) -> None:
        value = self._codec.decode_from_client(packet.payload)
        if isinstance(value, Hello):
            self._hello_unix_ns = self._hello_unix_ns or packet.at_unix_ns
        if not isinstance(value, Command) or self._hello_unix_ns is None:
            return
        t_s = (packet.at_unix_ns - self._hello_unix_ns) / 1e9
        for request in value.requests:
            live = self._live.pop(request.number, None)
            if live is not None:
                self._compare(live, request, t_s, packet.number)
            elif request.number > self._newest and len(self._recorded) < _REMEMBERED:
                self._recorded.setdefault(request.number, (request, t_s, packet.number))
