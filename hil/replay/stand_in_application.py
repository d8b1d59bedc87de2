"""A recorded application of the servo link that speaks to a live controller: sans-I/O, times are arguments.

Its packets leave when they left in the recording, counted from the hello; the session's token, the counters and the
reports seen are those of the session that runs now, and its requests are as recorded.
"""

from collections.abc import Iterator
from typing import Final

from hil.values.errors import MalformedDatagram
from hil.values.link import Address
from hil.values.servo import Command, Ended, FromClient, Goodbye, Hello, Refused, State, Welcome
from transport.capture.records import Packet
from transport.servo import ServoCodec

_HELLO_AGAIN_NS: Final = 50_000_000


class RecordedApplication:
    """Plays the application at ``client`` that spoke to ``controller`` in ``packets``."""

    def __init__(self, packets: Iterator[Packet], *, client: Address, controller: Address, codec: ServoCodec) -> None:
        self._codec = codec
        self._packets = self._own(packets, client, controller)
        self._hello: Hello | None = None
        self._hello_unix_ns = 0
        self._next: tuple[int, FromClient] | None = None
        self._token: int | None = None
        self._began_ns: int | None = None
        self._hello_due_ns = 0
        self._sequence = self._reflected = self._reports_seen = 0
        self.sent = self.received = self.states = self.malformed = 0
        self.ended_because = ""
        self._advance()

    @property
    def over(self) -> bool:
        """Whether there is nothing more to say, or nobody to say it to."""
        return bool(self.ended_because) or (self._next is None and self._token is not None) or self._hello is None

    def next_due_ns(self) -> int | None:
        """Return when :meth:`due` has something to send next; None when it has not."""
        if self.over:
            return None
        if self._token is None or self._began_ns is None:
            return self._hello_due_ns
        return None if self._next is None else self._began_ns + self._next[0]

    def due(self, *, now_ns: int) -> list[bytes]:
        """Return the datagrams that are due."""
        if self.over:
            return []
        if self._token is None or self._began_ns is None:
            if now_ns < self._hello_due_ns or self._hello is None:
                return []
            self._hello_due_ns = now_ns + _HELLO_AGAIN_NS
            return [self._encoded(self._hello)]
        datagrams = []
        while self._next is not None and self._began_ns + self._next[0] <= now_ns:
            datagrams.append(self._encoded(self._rewritten(self._next[1], self._token)))
            self._advance()
        return datagrams

    def receive(self, datagram: bytes, *, now_ns: int) -> None:
        """Take a datagram of the live controller."""
        try:
            packet = self._codec.decode_from_controller(datagram)
        except MalformedDatagram:
            self.malformed += 1
            return
        self.received += 1
        match packet:
            case Welcome() if self._token is None and self._hello is not None and packet.nonce == self._hello.nonce:
                self._token, self._began_ns = packet.token, now_ns
            case Refused() if self._token is None:
                self.ended_because = f"the controller refuses the session: {packet.reason}"
            case Ended() if packet.token == self._token:
                self.ended_because = f"the controller ended the session: {packet.reason}"
            case State() if packet.token == self._token:
                self.states += 1
                self._reflected = max(self._reflected, packet.sequence)
                for report in packet.reports:
                    # Reports come in order; what is seen is what came without a gap.
                    if report.number == self._reports_seen + 1:
                        self._reports_seen = report.number

    def _own(self, packets: Iterator[Packet], client: Address, controller: Address) -> Iterator[tuple[int, FromClient]]:
        for packet in packets:
            if (Address(*packet.source), Address(*packet.destination)) != (client, controller):
                continue
            try:
                value = self._codec.decode_from_client(packet.payload)
            except MalformedDatagram:
                self.malformed += 1
                continue
            if isinstance(value, Hello):
                if self._hello is None:
                    self._hello, self._hello_unix_ns = value, packet.at_unix_ns
            elif self._hello is not None:
                yield packet.at_unix_ns - self._hello_unix_ns, value

    def _advance(self) -> None:
        self._next = next(self._packets, None)

    def _rewritten(self, packet: FromClient, token: int) -> FromClient:
        self._sequence += 1
        if isinstance(packet, Command):
            return packet._replace(
                token=token,
                sequence=self._sequence,
                reflected_sequence=self._reflected,
                reports_seen=self._reports_seen,
            )
        if isinstance(packet, Goodbye):
            return packet._replace(token=token, sequence=self._sequence)
        return packet

    def _encoded(self, packet: FromClient) -> bytes:
        self.sent += 1
        return self._codec.encode_from_client(packet)
