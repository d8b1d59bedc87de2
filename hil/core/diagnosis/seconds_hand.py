"""The seconds hand effect (manual 7.4, 11.2): the arm stands before each next destination, and buzzes.

Recognised where it happens, in the cycle in which the fine interpolator has the next destination: by then the dead time
is over for both, so it does not shift the comparison, and what counts is whether the set point came to a standstill in
between. Nothing is done in cycles without a destination.

A *section* is the way from one destination the interpolator had to the next different one. It ends in a standstill when
the set point stands by then, or is slower than :data:`STANDS_BELOW` of the section's mean velocity: a DirectServo comes
near to its destination long before it is there exactly. Not counted are

- the last section of a motion: nothing comes after it;
- a destination that is where the arm stands, or the same once more: the application wants it to stand;
- a section of more than :data:`LONGEST_SECTION_NS`: destinations half a second apart are points to go to, not a stream
  (the slowest stream the manual knows, 11.1, is 100 to 200 ms). It ends the stream, and counting begins anew. So does a
  pause, and an override of 0.
"""

from collections import deque
from operator import sub
from typing import Final, NamedTuple

from hil.core.motion.destination_account import LONGEST_SECTION_NS
from hil.core.motion.set_point import SetPoint
from hil.values.robot import Seven

SHORTEST_SECTION_NS: Final = 10_000_000
"""Until so long after a section began nothing is judged, unless the set point stands exactly.

So a fast stream, which has no time to stand, costs next to nothing.
"""
STANDS_BELOW: Final = 0.1
LEAST_WAY_RAD: Final = 1e-6
"""A shorter way is none; no drive hears it."""
WINDOW: Final = 20
"""Sections that are looked back at."""
MANY: Final = 10
"""So many standstills among them are the effect; and so are :data:`IN_A_ROW` of the last."""
IN_A_ROW: Final = 5
IRREGULAR: Final = 1.25
"""Sections that end in standstills, so many times as long as the mean time between destinations: they are irregular."""
TELL_AGAIN_NS: Final = 5_000_000_000
_WINDOW_BITS: Final = (1 << WINDOW) - 1
_ROW_BITS: Final = (1 << IN_A_ROW) - 1


class Standstill(NamedTuple):
    """A section that ended in one."""

    way_ns: int
    """From the cycle with its destination until the set point stood, or nearly."""
    stood_ns: int
    """From then to the cycle with the next destination."""
    axis: int
    """The one that went farthest; 0 is A1."""
    way_rad: float


class Pattern(NamedTuple):
    """What was measured of a stream of destinations in the last sections, at most :data:`WINDOW`."""

    standstills: int
    sections: int
    spacing_mean_ms: float
    """Between arrivals of destinations."""
    spacing_max_ms: float
    way_ms: float
    """Mean time a section that ended in a standstill took."""
    stood_ms: float
    """Mean time the arm stood after it."""
    axis: int
    way_rad: float
    """Mean way of the axis that goes farthest, in these sections."""

    @property
    def cycle_ms(self) -> float:
        """The time between destinations that has to be bridged: the mean, where they come at regular intervals.

        Where they do not, the arm stands in the long ones, and these count.
        """
        bridged_ms = self.way_ms + self.stood_ms
        return bridged_ms if bridged_ms > IRREGULAR * self.spacing_mean_ms else self.spacing_mean_ms


class SecondsHand:
    """Watches the destinations of one motion; in bounded memory."""

    __slots__ = (
        "_arrivals_ns",
        "_began_ns",
        "_began_rad",
        "_goal_rad",
        "_history",
        "_sections",
        "_stands_since_ns",
        "_standstills",
        "_told_ns",
        "_told_standstills",
        "due",
        "looks_from_ns",
        "recognised",
        "standstills",
    )

    def __init__(self) -> None:
        self.standstills = 0
        """Sections that ended in one, in all."""
        self.recognised = False
        """Whether it was the seconds hand effect at any time."""
        self.due = False
        """Whether it is to be told."""
        self.looks_from_ns = 0
        """When a destination is looked at again; an attribute, because a motion may ask for it in every cycle."""
        self._told_ns: int | None = None
        self._told_standstills = 0
        self._goal_rad: Seven | None = None
        self._began_rad: Seven
        self._began_ns = 0
        self._stands_since_ns: int | None = None
        self._history = 0
        """A bit a section, the newest lowest: whether it ended in a standstill."""
        self._sections = 0
        self._arrivals_ns: deque[int] = deque(maxlen=WINDOW + 1)
        self._standstills: deque[Standstill] = deque(maxlen=WINDOW)

    def next_destination(self, goal_rad: Seven, arrived_ns: int, present: SetPoint, now_ns: int) -> None:
        """The interpolator leaves ``present``, which it had at ``now_ns``, for a destination.

        Need not be called before :attr:`looks_from_ns`.
        """
        elapsed_ns = now_ns - self._began_ns
        stands = self._stands_since_ns is not None
        before_rad = self._goal_rad
        if before_rad is not None:
            if goal_rad == before_rad or (stands and _way(present.position_rad, goal_rad)[1] < LEAST_WAY_RAD):
                return
            if elapsed_ns > LONGEST_SECTION_NS:
                self.begins_anew()
            else:
                self._judge(present, elapsed_ns, now_ns)
        self._goal_rad = goal_rad
        self._stands_since_ns = None
        self._began_rad = present.position_rad
        self._began_ns = now_ns
        self.looks_from_ns = now_ns + SHORTEST_SECTION_NS
        self._arrivals_ns.append(arrived_ns)

    def stands(self, now_ns: int) -> None:
        """The set point stands at the destination."""
        if self._stands_since_ns is None:
            self._stands_since_ns = now_ns
            self.looks_from_ns = 0

    def begins_anew(self) -> None:
        """The stream of destinations is interrupted."""
        self._goal_rad = self._stands_since_ns = None
        self.looks_from_ns = 0
        self._history = self._sections = 0
        self.due = False
        self._arrivals_ns.clear()
        self._standstills.clear()

    def told(self, now_ns: int) -> None:
        """It is told now; while it goes on, it is to be told again after a while."""
        self.due = False
        self._told_ns, self._told_standstills = now_ns, self.standstills

    @property
    def untold(self) -> bool:
        """Whether there were more standstills since it was told last, and it can be told what they were like."""
        return self.recognised and bool(self._standstills) and self.standstills > self._told_standstills

    def pattern(self) -> Pattern:
        """Return what was measured; there must have been a standstill in the window."""
        arrivals, stood = self._arrivals_ns, self._standstills
        spacings = [arrivals[place] - arrivals[place - 1] for place in range(1, len(arrivals))] or [0]
        sections = min(self._sections, WINDOW)
        many = len(stood)
        axes = [one.axis for one in stood]
        axis = max(set(axes), key=axes.count)
        of_axis = [one.way_rad for one in stood if one.axis == axis]
        return Pattern(
            self._history.bit_count(),
            sections,
            sum(spacings) / len(spacings) / 1e6,
            max(spacings) / 1e6,
            sum(one.way_ns for one in stood) / many / 1e6,
            sum(one.stood_ns for one in stood) / many / 1e6,
            axis,
            sum(of_axis) / len(of_axis),
        )

    def _judge(self, present: SetPoint, elapsed_ns: int, now_ns: int) -> None:
        axis, way_rad = _way(self._began_rad, present.position_rad)
        if way_rad < LEAST_WAY_RAD:
            return
        since_ns = self._stands_since_ns
        speed_rad_s = abs(present.velocity_rad_s[axis])
        stands = since_ns is not None or speed_rad_s * elapsed_ns * 1e-9 < STANDS_BELOW * way_rad
        self._history = history = (self._history << 1 | stands) & _WINDOW_BITS
        self._sections += 1
        if not stands:
            return
        self.standstills += 1
        stood_ns = 0 if since_ns is None else now_ns - since_ns
        self._standstills.append(Standstill(elapsed_ns - stood_ns, stood_ns, axis, way_rad))
        if (history & _ROW_BITS) == _ROW_BITS or history.bit_count() >= MANY:
            self.recognised = True
            self.due = self._told_ns is None or now_ns - self._told_ns >= TELL_AGAIN_NS


def _way(here: Seven, there: Seven) -> tuple[int, float]:
    """Return which axis goes farthest, and how far."""
    ways = list(map(abs, map(sub, there, here)))
    longest = max(ways)
    return ways.index(longest), longest
