"""How fast a motion runs through its own time: the program override, and the pause, which is an override of 0.

A motion counts in cycles of its own. At full tempo each control cycle is one of them. Below that the set point lies
between two of them, on the straight line from one to the other, so the arm stays on the motion's path whatever the
tempo does: velocities are scaled with the tempo, accelerations with its square. The tempo changes no faster than the
rated accelerations and jerks allow at the velocities the motion has, what the motion itself decelerates subtracted.
"""

import math
from collections.abc import Callable
from typing import Final

from hil.core.motion.set_point import STILL, SetPoint
from hil.values.arm import seven
from hil.values.motion import Fault
from hil.values.robot import JointLimits

_LEAST_SHARE: Final = 0.1
"""Of the rated acceleration, what a change of tempo may use at least while the motion uses all of it itself."""
_REALIGNING: Final = 0.005
"""Share of its cycles a motion loses after a change of tempo, for a fifth of a second at most."""
_SMALLEST_STEP: Final = 1e-6
_SMALLEST_SCALE: Final = 0.1
"""Below it, what moves is taken for slower than it is, because in the motions' time it would exceed every axis."""


class Tempo:
    """The tempo of one arm's motions, 0..1; it begins at 1."""

    def __init__(self, *, limits: JointLimits, cycle_s: float) -> None:
        self._acceleration = limits.acceleration_rad_s2
        self._jerk = limits.jerk_rad_s3
        self._cycle_s = cycle_s
        self._rate = 0.0
        self._before = self._latest = SetPoint(STILL, STILL)
        self._done = 1.0
        """Share of the way between the motion's last two cycles that is behind the arm."""
        self.scale = 1.0
        self.target = 1.0
        self.full = True
        """Whether the motion's cycles are the control cycles; an attribute, because every cycle asks for it."""

    @property
    def stands(self) -> bool:
        """Whether the motion's time stands still."""
        return self.scale == 0.0

    def aim(self, target: float, *, present: SetPoint, moving: bool) -> None:
        """Go to another tempo: gradually while a motion is ``moving``, at ``present``, the set point committed last."""
        self.target = target
        if not moving:
            self.scale, self._rate = target, 0.0
        if self.full and (self.scale != 1.0 or target != 1.0):
            self.full = False
            self._before = self._latest = present
            self._done = 1.0

    def begins(self, present: SetPoint) -> None:
        """A motion begins at rest, at ``present``."""
        self.scale, self._rate = self.target, 0.0
        self.full = self.target == 1.0
        self._before = self._latest = present
        self._done = 1.0

    def begins_anew(self, present: SetPoint) -> None:
        """The arm's set point was put at ``present``, whatever the motions before had made of it."""
        if self.full:
            return
        scale = max(self.scale, _SMALLEST_SCALE)
        velocity = seven([speed / scale for speed in present.velocity_rad_s])
        self._before = self._latest = SetPoint(present.position_rad, velocity)
        self._done = 1.0

    def takes_over_at(self, present: SetPoint) -> SetPoint:
        """Return where a motion takes over from the one before it, in the motions' time."""
        return present if self.full else self._latest

    @property
    def settled(self) -> bool:
        """Whether the arm is where the motion's last cycle is."""
        return self.full or self._done == 1.0 or self._before.position_rad == self._latest.position_rad

    def next(self, pull: Callable[[], SetPoint | Fault]) -> SetPoint | Fault:
        """Return the set point of this control cycle; ``pull`` gives that of the motion's next cycle."""
        self._change()
        self._done += self.scale if self.scale < 1.0 or self.target < 1.0 else 1.0 - self._lag()
        while self._done > 1.0:
            pulled = pull()
            if isinstance(pulled, Fault):
                return pulled
            self._before, self._latest = self._latest, pulled
            self._done -= 1.0
        if self.scale == 1.0 == self.target and self._done == 1.0:
            self.full = True
            return self._latest
        return self._between()

    def _lag(self) -> float:
        """Return what to lose of a cycle at full tempo, until the motion's cycles are the control cycles again."""
        if self._done == 1.0 or self._before.position_rad == self._latest.position_rad:
            self._done = 1.0
            return 0.0
        return min(_REALIGNING, self._done)

    def _between(self) -> SetPoint:
        done, scale, rate = self._done, self.scale, self._rate
        square = scale * scale
        position: list[float] = []
        velocity: list[float] = []
        acceleration: list[float] = []
        for here, there, v0, v1, a0, a1 in zip(
            self._before.position_rad,
            self._latest.position_rad,
            self._before.velocity_rad_s,
            self._latest.velocity_rad_s,
            self._before.acceleration_rad_s2,
            self._latest.acceleration_rad_s2,
            strict=True,
        ):
            speed = v0 + (v1 - v0) * done
            position.append(here + (there - here) * done)
            velocity.append(speed * scale)
            acceleration.append((a0 + (a1 - a0) * done) * square + speed * rate)
        return SetPoint(tuple(position), tuple(velocity), tuple(acceleration))  # type: ignore[arg-type]

    def _change(self) -> None:
        """Move the tempo one cycle towards its target."""
        left = self.target - self.scale
        if left == 0.0 and self._rate == 0.0:
            return
        fastest, strongest = self._allowed(slower=left < 0.0)
        wanted = math.copysign(min(fastest, math.sqrt(2.0 * strongest * abs(left))), left)
        step = strongest * self._cycle_s
        self._rate += min(max(wanted - self._rate, -step), step)
        change = self._rate * self._cycle_s
        if abs(left) <= max(abs(change), _SMALLEST_STEP) and change * left >= 0.0:
            self.scale, self._rate = self.target, 0.0
        else:
            self.scale = min(max(self.scale + change, 0.0), 1.0)

    def _allowed(self, *, slower: bool) -> tuple[float, float]:
        """Return the fastest change of the tempo per second, and the fastest change of that."""
        cycle_s = self._cycle_s
        rate, change = 1.0 / cycle_s, 1.0 / (cycle_s * cycle_s)
        square = self.scale * self.scale
        for speed, own, rated, jerk in zip(
            self._latest.velocity_rad_s,
            self._latest.acceleration_rad_s2,
            self._acceleration,
            self._jerk,
            strict=True,
        ):
            if speed == 0.0:
                continue
            own_share = -own if slower == (speed > 0.0) else own
            room = max(rated - max(own_share * square, 0.0), _LEAST_SHARE * rated)
            rate = min(rate, room / abs(speed))
            change = min(change, jerk / abs(speed))
        return rate, change
