"""The motions of robot applications in their order: the first has the arm once it has begun, the others wait.

A motion is known by the number its application gave it. The real-time system holds the active motion and the one
behind it (manual 7.10.4: the runtime of the second is there while the first still runs); what waits farther back is
not transferred yet.
"""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from hil.core.motion.application_motion import ApplicationMotion
from hil.core.motion.fine_interpolator import Trigger, next_state
from hil.core.motion.set_point import SetPoint
from hil.values.motion import MAX_MOTIONS, Fault, MotionEnd, MotionKind, MotionPhase
from hil.values.robot import Seven

REMEMBERED_ENDS = 64
REACHED = "the point was reached"
BLENDED = "blended into the next PTP"
RESTED = "timeout after the destination was reached"
STOPPED = "stopped by the application"


class EndedMotion(NamedTuple):
    """A motion that is over, when and why."""

    number: int
    motion: ApplicationMotion
    at_ns: int
    end: MotionEnd
    why: Fault


@dataclass(slots=True)
class Entry:
    """One motion in the queue."""

    number: int
    motion: ApplicationMotion
    begun: bool = False


class MotionQueue:
    """At most :data:`MAX_MOTIONS` motions; ``on_begin`` and ``on_end`` are told each begin (and when) and each end."""

    def __init__(self) -> None:
        self._entries: deque[Entry] = deque()
        self._ends: deque[EndedMotion] = deque(maxlen=REMEMBERED_ENDS)
        self.active: Entry | None = None
        """The motion that has the arm; an attribute, because every cycle asks for it several times."""
        self.on_begin: Callable[[Entry, int], None] | None = None
        self.on_end: Callable[[EndedMotion], None] | None = None
        self.started = 0
        """Motions that ever had the arm."""

    def __len__(self) -> int:
        return len(self._entries)

    def __iter__(self) -> Iterator[Entry]:
        return iter(self._entries)

    @property
    def first(self) -> Entry:
        """The motion whose turn it is; there must be one."""
        return self._entries[0]

    @property
    def full(self) -> bool:
        """Whether one more motion must be refused."""
        return len(self._entries) >= MAX_MOTIONS

    def add(self, number: int, motion: ApplicationMotion) -> None:
        """Queue ``motion`` behind the others."""
        self._entries.append(Entry(number, motion))

    def find(self, number: int) -> Entry | None:
        """Return the motion of that number while it runs or waits."""
        return next((entry for entry in self._entries if entry.number == number), None)

    def end_of(self, number: int) -> EndedMotion | None:
        """Return how the motion of that number ended, as far as it is remembered; the latest of that number."""
        return next((ended for ended in reversed(self._ends) if ended.number == number), None)

    def forget_ends(self) -> None:
        """Forget how motions ended: another application may use their numbers again."""
        self._ends.clear()

    def phases(self, *, may_begin: bool = True) -> Iterator[tuple[Entry, MotionPhase]]:
        """Yield every motion with where it is on its way; a pause lets none into the real-time system to begin."""
        for place, entry in enumerate(self._entries):
            if entry.begun:
                yield entry, MotionPhase.ACTIVE
            elif (place == 0 and may_begin) or (place == 1 and self._entries[0].begun):
                yield entry, MotionPhase.TRANSFERRED
            else:
                yield entry, MotionPhase.QUEUED

    def begin_next(self, start: SetPoint, *, measured_rad: Seven, now_ns: int) -> Fault | None:
        """Let the first motion take over from ``start``; return why it cannot."""
        entry = self.active = self._entries[0]
        entry.begun = True
        self.started += 1
        if self.on_begin is not None:
            self.on_begin(entry, now_ns)
        return entry.motion.begin(start, measured_rad=measured_rad, now_ns=now_ns)

    def next_blends(self, *, now_ns: int) -> bool:
        """Whether the active PTP has come so near to its point that the PTP behind it takes over."""
        if self.active is None or len(self._entries) < 2 or self._entries[1].motion.kind is not MotionKind.PTP:
            return False
        return self.active.motion.blend_begins(now_ns=now_ns)

    def finish(self, *, now_ns: int, blended: bool = False) -> None:
        """The active motion is over by itself."""
        entry = self._take_active()
        reached = BLENDED if blended else REACHED
        why = Fault(reached if entry.motion.kind is MotionKind.PTP else RESTED)
        self._tell(entry, MotionEnd.FINISHED, why, now_ns)

    def stop_active(self, *, now_ns: int) -> None:
        """The application stopped the active motion."""
        self._tell(self._take_active(), MotionEnd.STOPPED, Fault(STOPPED), now_ns)

    def withdraw(self, number: int, *, now_ns: int) -> None:
        """The application stopped a motion that still waits; those around it stay."""
        entry = next(entry for entry in self._entries if entry.number == number)
        self._entries.remove(entry)
        self._tell(entry, MotionEnd.STOPPED, Fault(STOPPED), now_ns)

    def fail(self, fault: Fault, *, now_ns: int, number: int | None = None) -> bool:
        """End a motion (the first one without ``number``) and all behind it; return whether it had the arm."""
        entries = list(self._entries)
        place = 0 if number is None else [entry.number for entry in entries].index(number)
        failed = entries[place:]
        self._entries = deque(entries[:place])
        if place == 0:
            self.active = None
        for entry in failed:
            why = fault if entry is failed[0] else Fault(f"a motion before it ended: {fault.reason}", fault.detail)
            self._tell(entry, MotionEnd.FAILED, why, now_ns)
        return bool(failed) and failed[0].begun

    def _take_active(self) -> Entry:
        self.active = None
        return self._entries.popleft()

    def _tell(self, entry: Entry, end: MotionEnd, why: Fault, now_ns: int) -> None:
        motion = entry.motion
        if not motion.ended:
            trigger = Trigger.MOTION_FAILED if end is MotionEnd.FAILED else Trigger.MOTION_STOPPED
            motion.interpolator = next_state(motion.interpolator, trigger)
        ended = EndedMotion(entry.number, entry.motion, now_ns, end, why)
        self._ends.append(ended)
        if self.on_end is not None:
            self.on_end(ended)
