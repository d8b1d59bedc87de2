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

from hil.core.diagnosis.seconds_hand import SecondsHand
from hil.core.motion.application_motion import Accounting
from hil.core.motion.destination_account import DestinationAccount
from hil.core.motion.queue import EndedMotion, Entry
from hil.core.motion.servo_motion import ServoMotion
from hil.values.motion import MotionKind

REMEMBERED_MOTIONS = 32


@dataclass(slots=True)
class _Kept:
    """What is remembered of a motion; the motion itself only as long as it runs, because it is large."""

    number: int
    kind: MotionKind
    account: DestinationAccount
    hand: SecondsHand
    motion: ServoMotion | None
    application: str
    began_ns: int
    accounting: Accounting
    ended_ns: int | None = None
    end: str = ""


class SetPointBook:
    """Accounts of the last servo motions that had the arm, in bounded memory."""

    def __init__(self) -> None:
        self._kept: deque[_Kept] = deque(maxlen=REMEMBERED_MOTIONS)

    def began(self, entry: Entry, application: str, *, now_ns: int) -> None:
        """A motion has the arm now."""
        motion = entry.motion
        if isinstance(motion, ServoMotion):
            kept = _Kept(
                entry.number,
                motion.kind,
                motion.account,
                motion.seconds_hand,
                motion,
                application,
                now_ns,
                motion.accounting,
            )
            self._kept.append(kept)

    def ended(self, ended: EndedMotion) -> None:
        """A motion is over."""
        if not self._kept or self._kept[-1].motion is not ended.motion:
            return
        kept = self._kept[-1]
        kept.motion, kept.accounting = None, ended.motion.accounting
        kept.ended_ns, kept.end = ended.at_ns, f"{ended.end.name}: {ended.why}"

    def report(self) -> list[dict[str, object]]:
        """Return them for the status file, the oldest first."""
        return [_report(kept) for kept in self._kept]


def _report(kept: _Kept) -> dict[str, object]:
    account, hand = kept.account, kept.hand
    accounting = kept.accounting if kept.motion is None else kept.motion.accounting
    taken, superseded, executed, executed_at_ns = accounting
    received = taken + account.refused
    per_s = account.executed_per_s(executed=executed, executed_at_ns=executed_at_ns)
    return {
        "motion": kept.number,
        "kind": kept.kind.name,
        "application": kept.application,
        "began_s": round(kept.began_ns / 1e9, 6),
        "ended_s": None if kept.ended_ns is None else round(kept.ended_ns / 1e9, 6),
        "end": kept.end,
        "sent": received + account.replaced_on_the_way,
        "replaced_on_the_way": account.replaced_on_the_way,
        "received": received,
        "accepted": taken,
        "refused": account.refused,
        "superseded": superseded,
        "executed": executed,
        "waiting": taken - superseded - executed,
        "age_us": account.ages.summary_us(),
        "executed_per_s": None if per_s is None else round(per_s, 3),
        "arrival_spacing": str(account.spacing),
        "arrival_spacing_ms": account.spacing.report(),
        "standstills": hand.standstills,
        "seconds_hand": hand.recognised,
    }
