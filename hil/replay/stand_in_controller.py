"""A recorded controller that speaks to a live client: its datagrams as they were, and what the client answers compared.

The client's own counter begins anew with each client, so it is compared by how it grows.
"""

from collections import deque
from collections.abc import Iterator
from typing import Final, NamedTuple

from hil.replay.fields import differences
from hil.replay.guess import Flow
from hil.replay.result import Moment, ReplayResult
from hil.values.errors import MalformedDatagram
from hil.values.fri import SEQUENCE_MODULUS
from hil.values.fri_messages import CommandMessage
from hil.values.link import Address
from transport.capture.records import Packet
from transport.fri import FriCodec

_REMEMBERED: Final = 1024


class _Recorded(NamedTuple):
    payload: bytes
    message: CommandMessage
    packet: int
    t_s: float


class RecordedController:
    """Says what the controller of ``flow`` said in ``packets``; the result has the recorded and the live answers."""

    def __init__(self, flow: Flow, packets: Iterator[Packet], result: ReplayResult) -> None:
        self._flow = flow
        self._codec = FriCodec(flow.release)
        self._packets = packets
        self._result = result
        self._expected: deque[_Recorded] = deque()
        """Recorded answers that no live one was compared with yet."""
        self._unclaimed: dict[int, tuple[bytes, CommandMessage]] = {}
        """Live answers to messages whose recorded answer is still to come, by the counter they reflect."""
        self._offset: int | None = None
        self._first_unix_ns: int | None = None
        self.sent = self.malformed = 0

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """Yield the recorded messages with their times since the first one [ns]."""
        for packet in self._packets:
            source, destination = Address(*packet.source), Address(*packet.destination)
            if (source, destination) == (self._flow.controller, self._flow.client):
                if self._first_unix_ns is None:
                    self._first_unix_ns = packet.at_unix_ns
                t_ns = packet.at_unix_ns - self._first_unix_ns
                self._result.recorded_s = self._result.reached_s = t_ns / 1e9
                self.sent += 1
                yield t_ns, packet.payload
            elif (source, destination) == (self._flow.client, self._flow.controller):
                self._expect(packet)

    def receive(self, datagram: bytes) -> None:
        """Take an answer of the live client."""
        try:
            message = self._codec.decode_command(datagram)
        except MalformedDatagram as error:
            self.malformed += 1
            self._result.note(f"a datagram of the client is no answer: {error}")
            return
        self._result.inputs += 1
        if len(self._unclaimed) >= _REMEMBERED:
            del self._unclaimed[next(iter(self._unclaimed))]
        self._unclaimed[message.reflected_sequence_counter] = datagram, message
        self._claim()

    def finish(self) -> None:
        """The recording is over, and the client had its time: what it did not answer is missing."""
        self._claim()
        while self._expected:
            self._lost(self._expected.popleft())

    def _expect(self, packet: Packet) -> None:
        try:
            message = self._codec.decode_command(packet.payload)
        except MalformedDatagram:
            return
        t_s = (packet.at_unix_ns - (self._first_unix_ns or packet.at_unix_ns)) / 1e9
        self._expected.append(_Recorded(packet.payload, message, packet.number, t_s))
        if len(self._expected) > _REMEMBERED:
            self._lost(self._expected.popleft())
        self._claim()

    def _claim(self) -> None:
        """Compare what is there on both sides, in the order of the recording."""
        while self._expected:
            recorded = self._expected[0]
            live = self._unclaimed.pop(recorded.message.reflected_sequence_counter, None)
            if live is None:
                if not any(_later(recorded.message.reflected_sequence_counter, other) for other in self._unclaimed):
                    return
                self._lost(self._expected.popleft())
                continue
            self._expected.popleft()
            self._compare(recorded, *live)

    def _compare(self, recorded: _Recorded, datagram: bytes, message: CommandMessage) -> None:
        result = self._result
        result.compared += 1
        if self._offset is None:
            self._offset = (message.sequence_counter - recorded.message.sequence_counter) % SEQUENCE_MODULUS
        counter = (message.sequence_counter - self._offset) % SEQUENCE_MODULUS
        if datagram == recorded.payload or message._replace(sequence_counter=counter) == recorded.message:
            result.identical += 1
            return
        found = list(differences(recorded.message, message._replace(sequence_counter=counter)))
        result.differ(Moment("client", recorded.t_s, -1, recorded.packet), found)

    def _lost(self, recorded: _Recorded) -> None:
        self._result.extra += 1
        what = f"the client did not answer message {recorded.message.reflected_sequence_counter}"
        self._result.differ_whole(Moment("client", recorded.t_s, -1, recorded.packet), what)


def _later(one: int, other: int) -> bool:
    return 0 < (other - one) % SEQUENCE_MODULUS < SEQUENCE_MODULUS // 2
