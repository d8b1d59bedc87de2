"""A recorded client that answers a live controller: sans-I/O, datagrams in and out.

Its answers carry the counters of the conversation that runs now; all else is as recorded. It keeps with the session:
in each session state it gives the answers that were recorded in that state, one after the other, and the last of them
again where the live state lasts longer.
"""

from collections.abc import Iterator
from contextlib import suppress
from typing import Final, NamedTuple

from hil.replay.guess import Flow, state_of
from hil.values.errors import MalformedDatagram
from hil.values.fri import SEQUENCE_MODULUS, SessionState
from hil.values.fri_messages import CommandMessage
from hil.values.link import Address
from transport.capture.records import Packet
from transport.fri import FriCodec

_REMEMBERED: Final = 256


class _Answer(NamedTuple):
    state: SessionState
    message: CommandMessage


class RecordedClient:
    """Answers like the client of ``flow`` in ``packets``, which are read as they are needed."""

    def __init__(self, flow: Flow, packets: Iterator[Packet]) -> None:
        self._codec = FriCodec(flow.release)
        self._answers = _answers(flow, packets, self._codec)
        self._next = next(self._answers, None)
        self._last: CommandMessage | None = None
        self._state = SessionState.IDLE
        self._sequence = 0
        self._since_answer = 0
        self.received = self.answered = self.repeated = self.malformed = 0
        self.states: list[SessionState] = []
        """Session states of the live controller, in order."""
        self.ended = False
        """Whether the live controller closed the session, or the recording has nothing more for it."""

    def receive(self, datagram: bytes) -> bytes | None:
        """Take a monitoring message and return the answer to it, if the recording has one."""
        try:
            message = self._codec.decode_monitoring(datagram)
        except MalformedDatagram:
            self.malformed += 1
            return None
        state = state_of(message)
        if message.connection is None or state is None:
            self.malformed += 1
            return None
        self.received += 1
        if state is not self._state:
            self._state = state
            self.states.append(state)
            self._last = None
            self._skip_to(state)
        if state is SessionState.IDLE:
            self.ended = True
            return None
        self._since_answer += 1
        if self._since_answer < (message.connection.receive_multiplier or 1):
            return None
        self._since_answer = 0
        return self._answer(message.sequence_counter)

    def _answer(self, reflected: int) -> bytes | None:
        if self._next is not None and self._next.state is self._state:
            self._last = self._next.message
            self._next = next(self._answers, None)
        elif self._last is not None:
            self.repeated += 1
            # Commanding goes on for as long as was recorded, then the recorded client is gone.
            if self._next is None and self._state is SessionState.COMMANDING_ACTIVE:
                self.ended = True
                return None
        if self._last is None:
            return None
        told = self._last._replace(sequence_counter=self._sequence, reflected_sequence_counter=reflected)
        self._sequence = (self._sequence + 1) % SEQUENCE_MODULUS
        self.answered += 1
        return self._codec.encode_command(told)

    def _skip_to(self, state: SessionState) -> None:
        """Pass over what was recorded in other states; where nothing in ``state`` follows, stay."""
        if state is SessionState.IDLE or self._next is None or self._next.state is state:
            return
        if state < self._next.state:
            return  # the live controller takes longer than the recorded one did
        while self._next is not None and self._next.state is not state:
            self._next = next(self._answers, None)


def _answers(flow: Flow, packets: Iterator[Packet], codec: FriCodec) -> Iterator[_Answer]:
    """Yield the recorded answers with the state of the message each of them is to."""
    states: dict[int, SessionState] = {}
    for packet in packets:
        source, destination = Address(*packet.source), Address(*packet.destination)
        with suppress(MalformedDatagram):
            if (source, destination) == (flow.controller, flow.client):
                message = codec.decode_monitoring(packet.payload)
                if message.connection is not None and (said := state_of(message)) is not None:
                    states[message.sequence_counter] = said
                    if len(states) > _REMEMBERED:
                        del states[next(iter(states))]
            elif (source, destination) == (flow.client, flow.controller):
                answer = codec.decode_command(packet.payload)
                state = states.get(answer.reflected_sequence_counter)
                if state is not None:
                    yield _Answer(state, answer)
