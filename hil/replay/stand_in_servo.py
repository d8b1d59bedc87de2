"""A recorded controller of the servo link that speaks to a live application: sans-I/O, times are arguments.

Its states leave when they left in the recording, counted from the application's hello. One that says a request is done
waits until the application has asked for it: until then the last state is told again, with a time that goes on, because
applications pace themselves by it. What the application asks for is compared request by request with the recording.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

from hil.replay.fields import differences
from hil.replay.result import Moment, ReplayResult
from hil.values.errors import MalformedDatagram
from hil.values.link import Address
from hil.values.servo import (
    Command,
    Ended,
    GoalReached,
    Goodbye,
    Hello,
    MotionEnded,
    Report,
    Request,
    RequestDone,
    State,
    Welcome,
)
from transport.capture.records import Packet
from transport.servo import ServoCodec

_REMEMBERED: Final = 1024
_NS_PER_MS: Final = 1_000_000

_PATIENCE_NS: Final = 1_000_000_000
"""How long the recording stands still for a live application that is slower than the recorded one."""


_FILLER_NS: Final = 5_000_000
"""Between two states while the recording stands still."""


class _Due(NamedTuple):
    """A packet of the recording, and when it leaves [ns since the hello]."""

    at_ns: int
    packet: State | Ended

    @property
    def requests_done(self) -> int:
        """How many requests it says are done."""
        return self.packet.requests_done if isinstance(self.packet, State) else 0


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
        self._stands_since_ns: int | None = None
        """Since when the recording stands still for the application; None: it goes on."""
        self._stood_ns = 0
        """How long it stood still so far, whole cycles."""
        self._filler_due_ns = 0
        self._last: State | None = None
        self._sequence = self._heard_sequence = 0
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
        return self._began_ns + self._next.at_ns if self._stands_since_ns is None else self._filler_due_ns

    def due(self, *, now_ns: int) -> list[bytes]:
        """Return the datagrams that are due."""
        datagrams = []
        while self._began_ns is not None and self._next is not None and now_ns >= self._began_ns + self._next.at_ns:
            if not self._may_go_on(self._next, now_ns):
                datagrams += self._filler(now_ns)
                break
            if self._stands_since_ns is not None:
                self._go_on(now_ns)
            datagrams.append(self._said(self._next.packet, self._stood_ns))
            self._result.recorded_s = self._result.reached_s = self._next.at_ns / 1e9
            self._next = next(self._states, None)
        self.sent += len(datagrams)
        return datagrams

    def _may_go_on(self, due: _Due, now_ns: int) -> bool:
        since_ns = now_ns if self._stands_since_ns is None else self._stands_since_ns
        return due.requests_done <= self._newest or now_ns - since_ns >= _PATIENCE_NS

    def _go_on(self, now_ns: int) -> None:
        if self._began_ns is not None and self._stands_since_ns is not None:
            stood_ns = self._whole_cycles(now_ns - self._stands_since_ns)
            self._began_ns += now_ns - self._stands_since_ns
            self._stood_ns += stood_ns
        self._stands_since_ns = None

    def _filler(self, now_ns: int) -> list[bytes]:
        """Tell the last state again, as time goes on."""
        if self._stands_since_ns is None:
            self._stands_since_ns, self._filler_due_ns = now_ns, now_ns + _FILLER_NS
            # Late for other reasons until now; the recording stood still only from here on.
            self._began_ns = now_ns - (0 if self._next is None else self._next.at_ns)
        if self._last is None or now_ns < self._filler_due_ns:
            return []
        self._filler_due_ns = now_ns + _FILLER_NS
        stood_ns = self._stood_ns + self._whole_cycles(now_ns - self._stands_since_ns)
        return [self._said(self._last._replace(reports=()), stood_ns)]

    def _whole_cycles(self, duration_ns: int) -> int:
        cycle_ns = self._cycle_ns
        return duration_ns // cycle_ns * cycle_ns

    @property
    def _cycle_ns(self) -> int:
        return (1 if self._welcome is None else self._welcome.cycle_ms) * _NS_PER_MS

    def _said(self, packet: State | Ended, stood_ns: int) -> bytes:
        """Return the datagram of a recorded packet, later by what the recording stood still."""
        if isinstance(packet, State):
            self._last = packet
            self._sequence += 1
            snapshot = packet.snapshot
            packet = packet._replace(
                sequence=self._sequence,
                reflected_sequence=self._heard_sequence,
                snapshot=snapshot._replace(
                    now_ns=snapshot.now_ns + stood_ns, cycle=snapshot.cycle + stood_ns // self._cycle_ns
                ),
                reports=tuple(_later(report, stood_ns) for report in packet.reports),
            )
        return self._codec.encode_from_controller(packet)

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
        self._heard_sequence = max(self._heard_sequence, packet.sequence)
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
            self._result.differ_whole(Moment("application", t_s, -1, packet), what)
        for number, request in sorted(self._live.items()):
            self._result.missing += 1
            what = f"the application asked for {type(request).__name__} {number}, which is not in the recording"
            self._result.differ_whole(Moment("application", self._result.recorded_s, -1, 0), what)

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
            self._result.differ(Moment("application", t_s, -1, packet), found)
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
                    if isinstance(value, Welcome):
                        self._welcome = self._welcome or value
                    elif isinstance(value, State | Ended) and self._belongs(value):
                        yield _Due(packet.at_unix_ns - self._hello_unix_ns, value)
            except MalformedDatagram:
                continue

    def _belongs(self, value: State | Ended) -> bool:
        """Whether a recorded packet is of the first session."""
        return self._welcome is not None and value.token == self._welcome.token

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


def _later(report: Report, by_ns: int) -> Report:
    """Return a report whose moment, if it has one, is later."""
    if isinstance(report, RequestDone | GoalReached | MotionEnded):
        return report._replace(at_ns=report.at_ns + by_ns)
    return report
