"""One connection of the responder: bytes and times in, writes and socket settings out."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from hil.values.tcp_probe import Behaviour
from transport.tcp.messages import (
    BODY_MOST_BYTES,
    HEAD_BYTES,
    Greeting,
    NotTheProbe,
    PeerSettings,
    Reply,
    Request,
    pack_refusal,
    read_request,
)

READ_MOST_BYTES: Final = 2 * (HEAD_BYTES + BODY_MOST_BYTES)
IDLE_NS: Final = 10_000_000_000
LIFETIME_NS: Final = 60_000_000_000
EMULATED_DELAY_NS: Final = 200_000_000
_WAITED_NS: Final = 20_000_000
"""Parts of a request that are farther apart: the second one had to wait for an acknowledgement."""
_S: Final = 1_000_000_000

_FIRST_SETTINGS: Final = {
    Behaviour.GOOD: PeerSettings(two_writes=False, no_delay=True, quick_ack=True),
    Behaviour.NAGLE: PeerSettings(two_writes=True, no_delay=False, quick_ack=True),
    Behaviour.DELAYED_ACK: PeerSettings(two_writes=False, no_delay=True, quick_ack=False),
    Behaviour.DELAYED_ACK_200MS: PeerSettings(two_writes=False, no_delay=True, quick_ack=False),
}


class Ending(StrEnum):
    """Why a connection ended."""

    CLOSED = "closed by the other side"
    MALFORMED = "no request of this protocol"
    IDLE = "idle"
    LONG = "too long"
    FAST = "too fast"
    NOT_READ = "replies not read"
    STOPPED = "end of the run"


@dataclass(frozen=True, slots=True)
class Step:
    """One thing for the shell to do: write, after TCP_NODELAY was set to ``no_delay`` where that is not None."""

    write: bytes = b""
    no_delay: bool | None = None


class Allowance:
    """So many turns a second, after ``most`` at once: what strangers may cost the machine."""

    def __init__(self, *, per_second: int, most: int) -> None:
        self._turn_ns = _S // per_second
        self._saved_most_ns = most * self._turn_ns
        self._saved_ns = self._saved_most_ns
        self._at_ns: int | None = None

    def take(self, now_ns: int) -> bool:
        """Return whether there is a turn, and take it."""
        if self._at_ns is not None:
            self._saved_ns = min(self._saved_most_ns, self._saved_ns + max(0, now_ns - self._at_ns))
        self._at_ns = now_ns
        if self._saved_ns < self._turn_ns:
            return False
        self._saved_ns -= self._turn_ns
        return True


class Responder:
    """Answers one peer. The shell does the steps in their order, and reads on while :attr:`reads`.

    Times are those of any one monotonic clock. After every receive the shell sets TCP_QUICKACK to :attr:`quick_ack`.
    """

    def __init__(self, behaviour: Behaviour, *, now_ns: int, can_quick_ack: bool = True) -> None:
        first = _FIRST_SETTINGS[behaviour]
        self.settings = PeerSettings(first.two_writes, first.no_delay, first.quick_ack and can_quick_ack)
        self.ending: Ending | None = None
        """Why the shell should close the connection, once what is to be written is written."""
        self.answered = 0
        self._behaviour = behaviour
        self._can_quick_ack = can_quick_ack
        self._began_ns = self._last_ns = now_ns
        self._data = bytearray()
        self._first_ns = now_ns
        self._complete_ns = now_ns
        self._request: Request | None = None
        """The request that is to be answered next."""
        self._held_until_ns: int | None = None
        self._refusal = b""

    @property
    def quick_ack(self) -> bool:
        """Whether what was received is to be acknowledged at once."""
        return self.settings.quick_ack

    @property
    def reads(self) -> bool:
        """Whether it takes more bytes now."""
        return self._request is None and self.ending is None

    @property
    def due_ns(self) -> int:
        """When :meth:`steps` has something to do although nothing was received."""
        if self._held_until_ns is not None:
            return self._held_until_ns
        return min(self._last_ns + IDLE_NS, self._began_ns + LIFETIME_NS)

    def opening(self, *, system: str, software: str) -> Step:
        """Return the first step: the greeting."""
        return Step(Greeting(system, software).pack(), self.settings.no_delay)

    def receive(self, data: bytes, *, now_ns: int) -> None:
        """Take what the peer sent; nothing: it closed."""
        if not data:
            self.ending = Ending.CLOSED
            return
        if not self._data:
            self._first_ns = now_ns
        self._data += data
        self._look(now_ns)

    def refuse(self, ending: Ending, sentence: str) -> None:
        """End the connection with a sentence."""
        self.ending = ending
        self._refusal = pack_refusal(sentence)
        self._request = self._held_until_ns = None

    def steps(self, *, now_ns: int, retransmissions: int = 0) -> list[Step]:
        """Return what is to be done now."""
        if self.ending is None and self._held_until_ns is None and now_ns >= self.due_ns:
            self._end_for_time(now_ns)
        steps: list[Step] = []
        while self._request is not None and self.ending is None:
            if self._held_until_ns is not None and now_ns < self._held_until_ns:
                break
            steps += self._answer(self._request, now_ns, retransmissions)
        if self._refusal:
            steps.append(Step(self._refusal))
            self._refusal = b""
        return steps

    def _end_for_time(self, now_ns: int) -> None:
        if now_ns >= self._began_ns + LIFETIME_NS:
            self.refuse(Ending.LONG, f"a connection lasts {LIFETIME_NS // _S} s at most; connect again")
        else:
            self.refuse(Ending.IDLE, f"no request came for {IDLE_NS // _S} s")

    def _look(self, now_ns: int) -> None:
        """Take the next request, once it is complete."""
        try:
            request = read_request(self._data)
        except NotTheProbe as error:
            self.refuse(Ending.MALFORMED, str(error))
            return
        if request is None or len(self._data) < HEAD_BYTES + request.body_bytes:
            return
        del self._data[: HEAD_BYTES + request.body_bytes]
        self._request, self._complete_ns = request, now_ns
        if self._behaviour is Behaviour.DELAYED_ACK_200MS and now_ns - self._first_ns >= _WAITED_NS:
            self._held_until_ns = self._first_ns + EMULATED_DELAY_NS

    def _answer(self, request: Request, now_ns: int, retransmissions: int) -> list[Step]:
        if self._held_until_ns is not None:
            # The emulated acknowledgement: only now has the second part come.
            self._complete_ns = now_ns
        before = self.settings
        if self._behaviour is Behaviour.GOOD:
            after = before.after(request.wishes)
            self.settings = PeerSettings(after.two_writes, after.no_delay, after.quick_ack and self._can_quick_ack)
        reply = Reply(
            sequence=request.sequence,
            settings=self.settings,
            retransmissions=retransmissions,
            parts_apart_ns=self._complete_ns - self._first_ns,
            thought_ns=now_ns - self._complete_ns,
            body_bytes=request.body_bytes,
        )
        head, body = reply.pack()
        no_delay = None if self.settings.no_delay == before.no_delay else self.settings.no_delay
        self.answered += 1
        self._request = self._held_until_ns = None
        self._last_ns = self._first_ns = now_ns
        if self._data:
            self._look(now_ns)
        if self.settings.two_writes:
            return [Step(head, no_delay), Step(body)]
        return [Step(head + body, no_delay)]
