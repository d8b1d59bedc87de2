"""What a client has asked for and does not know the outcome of yet."""

from collections import deque
from collections.abc import Callable
from typing import Final

from hil.client.servo.errors import IllegalStateException
from hil.values.servo import (
    MAX_REQUESTS_IN_PACKET,
    FlangeLocated,
    FrameDescribed,
    LoadValidated,
    Request,
    RequestDone,
    RequestError,
    SetDestination,
)

MAX_OUTSTANDING: Final = 64
"""Requests the controller has not taken yet; one more is refused at the call."""
MAX_SUPERSEDED: Final = 1024
"""Superseded destinations that wait for the outcome of a newer one; the oldest gives up when one more does."""
_GIVEN_UP: Final = f"more than {MAX_SUPERSEDED} newer destinations followed before the controller answered"
_LOST: Final = "the controller's answer to this request was lost"


class Pending:
    """One request; ``done`` says what became of it, or of the one that superseded it, once that is known."""

    __slots__ = ("answer", "done", "older", "request", "superseded")

    def __init__(self, request: Request) -> None:
        self.request = request
        self.done: RequestDone | None = None
        self.answer: FrameDescribed | FlangeLocated | LoadValidated | None = None
        """What was asked for, of a question; it comes before ``done``."""
        self.superseded = False
        self.older: deque[Pending] = deque()
        """Requests this one superseded, which share its outcome unless they had one of their own."""

    def resolve(self, done: RequestDone) -> None:
        """Set the outcome, also of what this request superseded."""
        for pending in (self, *self.older):
            if pending.done is None:
                pending.done = done


class RequestBook:
    """Numbers requests and keeps them until the controller says what became of them."""

    def __init__(self) -> None:
        self.superseded = 0
        """Destinations that were replaced by a newer one before the controller was known to have them."""
        self._last_number = 0
        self._outstanding: deque[Pending] = deque()
        self._unresolved: dict[int, Pending] = {}

    def __len__(self) -> int:
        """How many requests the controller is not known to have."""
        return len(self._outstanding)

    def add(self, make: Callable[[int], Request]) -> Pending:
        """Take the request that ``make`` returns for its number.

        A destination supersedes one of the same motion that is still outstanding. Raises
        :class:`IllegalStateException` when too many are.
        """
        number = self._last_number + 1
        pending = Pending(make(number))
        if isinstance(pending.request, SetDestination):
            self._supersede(pending, pending.request.motion)
        if len(self._outstanding) >= MAX_OUTSTANDING:
            raise IllegalStateException(
                f"{MAX_OUTSTANDING} requests wait for the controller already; wait for their outcome before asking more"
            )
        self._last_number = number
        self._outstanding.append(pending)
        self._unresolved[number] = pending
        return pending

    def to_send(self) -> tuple[Request, ...]:
        """Return what goes into the next packet: the oldest outstanding requests."""
        outstanding = self._outstanding
        if not outstanding:
            return ()
        return tuple([outstanding[place].request for place in range(min(len(outstanding), MAX_REQUESTS_IN_PACKET))])

    def taken(self, number: int) -> None:
        """The controller has, or refused, everything up to ``number``: it is not sent again."""
        while self._outstanding and self._outstanding[0].request.number <= number:
            self._outstanding.popleft()

    def resolve(self, done: RequestDone) -> Request | None:
        """Note what became of a request and return that; None for one that is not waited for."""
        self.taken(done.request)
        pending = self._unresolved.pop(done.request, None)
        if pending is None:
            return None
        pending.resolve(done)
        # Reports come in the order of the requests: an older request that has none by now gets none of its own.
        for number in [number for number in self._unresolved if number < done.request]:
            older = self._unresolved.pop(number)
            if not older.superseded:
                older.resolve(RequestDone(done.number, number, done.at_ns, RequestError.ILLEGAL_STATE, _LOST))
        return pending.request

    def waits_for(self, number: int) -> bool:
        """Whether it is not known yet what became of the request of that number."""
        return number in self._unresolved

    def answered(self, answer: FrameDescribed | FlangeLocated | LoadValidated) -> None:
        """Note the answer to a question."""
        pending = self._unresolved.get(answer.request)
        if pending is not None:
            pending.answer = answer

    def _supersede(self, newer: Pending, motion: int) -> None:
        for older in self._outstanding:
            if isinstance(older.request, SetDestination) and older.request.motion == motion:
                older.superseded = True
                older.older.append(older)
                newer.older, older.older = older.older, deque()
                self._outstanding.remove(older)
                self.superseded += 1
                if len(newer.older) > MAX_SUPERSEDED:
                    self._give_up(newer.older.popleft())
                return

    def _give_up(self, oldest: Pending) -> None:
        number = oldest.request.number
        if self._unresolved.pop(number, None) is not None:
            oldest.resolve(RequestDone(0, number, 0, RequestError.ILLEGAL_STATE, _GIVEN_UP))
