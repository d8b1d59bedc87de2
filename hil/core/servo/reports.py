"""What a client must learn: numbered reports, told again in every state packet until the client says it saw them."""

from collections import deque
from collections.abc import Callable

from hil.values.servo import MAX_REPORTS_IN_PACKET, Report

MAX_REPORTS = 256


class ReportLog:
    """Reports of one session; when a client takes none for too long, the oldest are lost, and counted."""

    def __init__(self) -> None:
        self._unseen: deque[Report] = deque(maxlen=MAX_REPORTS)
        self._last_number = 0
        self.lost = 0

    def add(self, make: Callable[[int], Report]) -> None:
        """Append the report that ``make`` returns for its number."""
        self._last_number += 1
        if len(self._unseen) == MAX_REPORTS:
            self.lost += 1
        self._unseen.append(make(self._last_number))

    def seen(self, number: int) -> None:
        """The client saw everything up to ``number``."""
        while self._unseen and self._unseen[0].number <= number:
            self._unseen.popleft()

    def to_tell(self) -> tuple[Report, ...]:
        """Return what goes into the next state packet: the oldest unseen ones."""
        if not self._unseen:
            return ()
        return tuple(self._unseen[place] for place in range(min(len(self._unseen), MAX_REPORTS_IN_PACKET)))
