"""Findings of a run, in bounded memory, told when they are new and then at most now and then."""

from collections.abc import Callable
from dataclasses import dataclass

from hil.core.events import Diagnosed, Event
from hil.values.finding import Finding

MAX_SUBJECTS = 256
"""Things that findings are kept of; what is found of more is counted only."""
TELL_EVERY_NS = 10_000_000_000


@dataclass(slots=True)
class _Kept:
    first_ns: int
    last_ns: int
    worst: Finding
    count: int
    told_ns: int


class FindingLog:
    """Keeps the worst finding of each kind and subject."""

    def __init__(self, emit: Callable[[Event], None]) -> None:
        self._emit = emit
        self._kept: dict[tuple[str, str], _Kept] = {}
        self.not_kept = 0

    def add(self, finding: Finding, *, subject: str = "", now_ns: int) -> None:
        """Book that ``finding`` was made again; ``subject`` is what it is of, such as a motion or an axis.

        It is told at once when it is new, or worse than before, otherwise at most every ten seconds.
        """
        key = finding.kind, subject
        kept = self._kept.get(key)
        if kept is None:
            if len(self._kept) >= MAX_SUBJECTS:
                self.not_kept += 1
                return
            self._kept[key] = _Kept(now_ns, now_ns, finding, 1, now_ns)
            self._emit(Diagnosed(now_ns, finding))
            return
        kept.count += 1
        kept.last_ns = now_ns
        worse = finding.severity.value > kept.worst.severity.value
        if finding.severity.value >= kept.worst.severity.value:
            kept.worst = finding
        if worse or now_ns - kept.told_ns >= TELL_EVERY_NS:
            kept.told_ns = now_ns
            self._emit(Diagnosed(now_ns, finding))

    def worst(self) -> list[Finding]:
        """Return the worst finding of each kind and subject, the worst first."""
        return [one.worst for _, one in self._worst_first()]

    def report(self) -> list[dict[str, object]]:
        """Return them for the status file, the worst first; times in seconds."""
        return [
            {
                "subject": subject,
                "first_s": round(one.first_ns / 1e9, 6),
                "last_s": round(one.last_ns / 1e9, 6),
                "count": one.count,
                **one.worst.as_dict(),
            }
            for subject, one in self._worst_first()
        ]

    def _worst_first(self) -> list[tuple[str, _Kept]]:
        kept = ((subject, one) for (_, subject), one in self._kept.items())
        return sorted(kept, key=lambda item: (-item[1].worst.severity.value, item[1].first_ns))
