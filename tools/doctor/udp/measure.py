"""The measurement itself: an observer that asks for a frame now and then, at all phases of the controller's cycle."""

from collections.abc import Callable
from typing import Final

from hil.clock import Clock
from hil.core.settings import NS_PER_MS
from hil.values.errors import MalformedDatagram
from hil.values.servo import Command, DescribeFrame, Ended, Goodbye, ServoClientCodec, State
from tools.doctor.udp.opening import Joined
from tools.doctor.udp.stamped import Gone, Heard, TimedSocket
from tools.doctor.udp.tally import Tally

SILENCE_NS: Final = 1_500_000_000
"""Without a datagram for so long it is over."""
SETTLE_NS: Final = 500_000_000
"""How long the last answers may take, after the time is up."""
FAREWELLS: Final = 3
_GOLDEN: Final = 0.6180339887498949
"""Its multiples are spread over the cycle evenly, however many there are."""


def watch(
    sock: TimedSocket,
    codec: ServoClientCodec,
    joined: Joined,
    *,
    seconds: float,
    clock: Clock,
    progress: Callable[[float], None],
) -> Tally:
    """Watch for ``seconds``; ``progress`` gets them, about one a second. What ends it early is in the tally."""
    one = _Watch(sock, codec, joined, clock)
    try:
        one.run(round(seconds * 1e9), progress)
    except Gone as gone:
        one.tally.ended_because = str(gone)
    finally:
        # After Ctrl-C too: the seat would be taken until the watchdog frees it.
        one.leave()
    return one.tally


class _Watch:
    def __init__(self, sock: TimedSocket, codec: ServoClientCodec, joined: Joined, clock: Clock) -> None:
        self.tally = Tally(joined.welcome.token)
        self._sock, self._codec, self._clock = sock, codec, clock
        self._token = joined.welcome.token
        self._period_ns = joined.period_ms * NS_PER_MS
        self._cycle_ns = joined.welcome.cycle_ms * NS_PER_MS
        self._sequence = joined.commands_sent
        self._requests = 0
        self._heard_ns = joined.first_heard.arrived_ns
        self._take(joined.first, joined.first_heard)

    def run(self, length_ns: int, progress: Callable[[float], None]) -> None:
        """Send and receive until the time is up, and the last requests are answered or lost."""
        began_ns = self._clock.now_ns()
        place = told_s = 0
        while not self.tally.ended_because:
            now_ns = self._clock.now_ns()
            gone_ns = now_ns - began_ns
            over = gone_ns >= length_ns
            if over and (not self.tally.requests_open or gone_ns >= length_ns + SETTLE_NS):
                return
            if gone_ns // 1_000_000_000 > told_s:
                told_s = gone_ns // 1_000_000_000
                progress(told_s)
            due_ns = began_ns + place * self._period_ns + round(place * _GOLDEN % 1.0 * self._cycle_ns)
            if now_ns >= due_ns:
                self.tally.send_late.add(now_ns - due_ns)
                self._send(asks=not over)
                # After a stall of our own: no burst.
                place = max(place + 1, gone_ns // self._period_ns)
            elif (heard := self._sock.receive((due_ns - now_ns) * 1e-9)) is not None:
                self._hear(heard)
            elif now_ns - self._heard_ns > SILENCE_NS:
                self.tally.ended_because = f"nothing came any more for {SILENCE_NS / 1e9:g} s"

    def leave(self) -> None:
        """Say goodbye, a few times, because each may be lost."""
        for _ in range(FAREWELLS):
            self._sequence += 1
            try:
                self._sock.send(self._codec.encode_from_client(Goodbye(self._token, self._sequence)))
            except Gone:
                return

    def _send(self, *, asks: bool) -> None:
        self._sequence += 1
        requests: tuple[DescribeFrame, ...] = ()
        if asks and self.tally.may_ask:
            self._requests += 1
            requests = (DescribeFrame(self._requests, 0),)
        newest, seen = self.tally.states.newest, self.tally.reports_seen
        datagram = self._codec.encode_from_client(
            Command(self._token, self._sequence, newest, seen, wants_state=not asks, requests=requests)
        )
        sent_ns = self._clock.now_ns()
        if self._sock.send(datagram) and requests:
            self.tally.asked(number=self._requests, sequence=self._sequence, sent_ns=sent_ns)

    def _hear(self, heard: Heard) -> None:
        try:
            packet = self._codec.decode_from_controller(heard.datagram)
        except MalformedDatagram:
            return
        self._heard_ns = self._clock.now_ns()
        if isinstance(packet, State):
            self._take(packet, heard)
        elif isinstance(packet, Ended) and packet.token == self._token:
            self.tally.ended_because = f"the controller ended the session: {packet.reason}"

    def _take(self, state: State, heard: Heard) -> None:
        self.tally.heard(state, arrived_ns=heard.arrived_ns, waited_ns=heard.waited_ns)
        self.tally.dropped_here = self._sock.dropped
