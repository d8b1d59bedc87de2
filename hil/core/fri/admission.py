"""What every datagram of the FRI link meets before anything else sees it: peer, decode, sequence, latency budget.

The order is the design's, with one change: the peer comes first, because the kernel's filter (the socket is connected
to its one peer) comes first too, and a stranger's bytes are not worth parsing. Content (finite, shape, limits) is
judged by :mod:`hil.core.fri.commands` once it is known what the session does with it.
"""

from typing import NamedTuple

from hil.core.fri.sequence import SequenceTracker
from hil.values.errors import MalformedDatagram
from hil.values.fri_messages import CommandMessage, ControllerCodec
from hil.values.link import Address
from hil.values.outcomes import Outcome


class Admitted(NamedTuple):
    """A datagram that is an answer to one of our messages; ``outcome`` ACCEPTED or LATE."""

    message: CommandMessage
    age_ns: int
    outcome: Outcome
    detail: str
    client_restarted_from: int | None


class Dropped(NamedTuple):
    """A datagram that is ignored."""

    outcome: Outcome
    detail: str


class Admission:
    """One peer, one codec, one budget."""

    def __init__(self, *, peer: Address, codec: ControllerCodec, tracker: SequenceTracker, budget_ns: int) -> None:
        self._peer = peer
        self._codec = codec
        self._tracker = tracker
        self._budget_ns = budget_ns

    def admit(self, datagram: bytes, sender: Address, *, now_ns: int) -> Admitted | Dropped:
        """Return what ``datagram`` is; books its counters when it is an answer. Raises nothing."""
        if sender != self._peer:
            return Dropped(Outcome.STRANGER, f"{len(datagram)} bytes from {sender}; the peer is {self._peer}")
        try:
            message = self._codec.decode_command(datagram)
        except MalformedDatagram as error:
            return Dropped(error.outcome, error.detail)
        verdict = self._tracker.judge(message.reflected_sequence_counter, now_ns=now_ns)
        if verdict.outcome is not Outcome.ACCEPTED:
            return Dropped(verdict.outcome, verdict.detail)
        before = self._tracker.client_counter
        restarted = self._tracker.answered(message.reflected_sequence_counter, message.sequence_counter)
        outcome, detail = Outcome.ACCEPTED, ""
        if verdict.age_ns > self._budget_ns:
            outcome = Outcome.LATE
            detail = (
                f"the answer to message {message.reflected_sequence_counter} came after "
                f"{verdict.age_ns / 1e6:.2f} ms, {(verdict.age_ns - self._budget_ns) / 1e6:.2f} ms "
                f"over the budget of {self._budget_ns / 1e6:g} ms"
            )
        return Admitted(message, verdict.age_ns, outcome, detail, before if restarted else None)
