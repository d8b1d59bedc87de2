"""Set-point accounting: what became of the destinations of each servo motion, for status file and summary.

For every motion: ``sent`` = ``replaced_on_the_way`` + ``received``; ``received`` = ``accepted`` + ``refused``;
``accepted`` = ``executed`` + ``superseded`` + ``waiting``. What is waiting when the motion ends is never executed.

``sent`` is what the application asked for as far as can be known here. A client numbers all its requests, and gives up
none but destinations that a newer one of the same motion replaces; so a number that never came was one of those. It is
booked to the motion of the next destination that comes. What is still on its way is not known, nor when the client sent
anything: ages count from the arrival.
"""

from collections import deque
from dataclasses import dataclass

from hil.core.motion.queue import EndedMotion, Entry
from hil.core.motion.servo_motion import ServoMotion

REMEMBERED_MOTIONS = 32


@dataclass(slots=True)
class _Kept:
    number: int
    motion: ServoMotion
    application: str
    began_ns: int
    ended_ns: int | None = None
    end: str = ""


class SetPointBook:
    """Accounts of the last servo motions that had the arm, in bounded memory."""

    def __init__(self) -> None:
        self._kept: deque[_Kept] = deque(maxlen=REMEMBERED_MOTIONS)

    def began(self, entry: Entry, application: str, *, now_ns: int) -> None:
        """A motion has the arm now."""
        if isinstance(entry.motion, ServoMotion):
            self._kept.append(_Kept(entry.number, entry.motion, application, now_ns))

    def ended(self, ended: EndedMotion) -> None:
        """A motion is over."""
        if not self._kept or self._kept[-1].motion is not ended.motion:
            return
        kept = self._kept[-1]
        kept.ended_ns, kept.end = ended.at_ns, f"{ended.end.name}: {ended.why}"

    def report(self) -> list[dict[str, object]]:
        """Return them for the status file, the oldest first."""
        return [_report(kept) for kept in self._kept]


def _report(kept: _Kept) -> dict[str, object]:
    motion = kept.motion
    account, accounting, hand = motion.account, motion.accounting, motion.seconds_hand
    received = accounting.received + account.refused
    per_s = account.executed_per_s(executed=accounting.executed, executed_at_ns=accounting.executed_at_ns)
    return {
        "motion": kept.number,
        "kind": motion.kind.name,
        "application": kept.application,
        "began_s": round(kept.began_ns / 1e9, 6),
        "ended_s": None if kept.ended_ns is None else round(kept.ended_ns / 1e9, 6),
        "end": kept.end,
        "sent": received + account.replaced_on_the_way,
        "replaced_on_the_way": account.replaced_on_the_way,
        "received": received,
        "accepted": accounting.received,
        "refused": account.refused,
        "superseded": accounting.superseded,
        "executed": accounting.executed,
        "waiting": accounting.received - accounting.superseded - accounting.executed,
        "age_us": account.ages.summary_us(),
        "executed_per_s": None if per_s is None else round(per_s, 3),
        "arrival_spacing": str(account.spacing),
        "arrival_spacing_ms": account.spacing.report(),
        "standstills": hand.standstills,
        "seconds_hand": hand.recognised,
    }
