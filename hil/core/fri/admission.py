"""What every datagram of the FRI link meets before anything else sees it: peer, decode, sequence, latency budget.

The order is the design's, with one change: the peer comes first, because the kernel's filter (the socket is connected
to its one peer) comes first too, and a stranger's bytes are not worth parsing. Content (finite, shape, limits) is
judged by :mod:`hil.core.fri.commands` once it is known what the session does with it.
"""

from typing import Final, NamedTuple

from hil.core.fri.sequence import SequenceTracker
from hil.values.errors import MalformedDatagram
from hil.values.fri import Release
from hil.values.fri_messages import CommandMessage, ControllerCodec
from hil.values.link import Address
from hil.values.outcomes import Outcome
from hil.values.tuples import new_tuple

# A member of an enumeration costs a search each time it is named by its class.
_ACCEPTED: Final = Outcome.ACCEPTED


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
    looks_like: Release | None = None
    """The release that the client seems to speak, where that is why."""
    overtaken: tuple[int, int] | None = None
    """The message that a reordered answer is to, and its age then in nanoseconds."""


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
            return Dropped(error.outcome, error.detail, error.looks_like)
        tracker, counter, reflected = self._tracker, message[0], message[1]
        age_ns = tracker.fresh_age_ns(reflected, now_ns=now_ns)
        if age_ns is None:
            outcome, age_ns, detail = tracker.judge(reflected, now_ns=now_ns)
            return Dropped(outcome, detail, None, (reflected, age_ns) if outcome is Outcome.REORDERED else None)
        before = tracker.client_counter
        restarted_from = before if tracker.answered(reflected, counter) else None
        if age_ns <= self._budget_ns:
            return new_tuple(Admitted, (message, age_ns, _ACCEPTED, "", restarted_from))
        detail = (
            f"the answer to message {reflected} came after "
            f"{age_ns / 1e6:.2f} ms, {(age_ns - self._budget_ns) / 1e6:.2f} ms "
            f"over the budget of {self._budget_ns / 1e6:g} ms"
        )
        return Admitted(message, age_ns, Outcome.LATE, detail, restarted_from)
