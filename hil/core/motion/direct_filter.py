"""The digital filter of DirectServo: second order, two equal real poles, limited in velocity and acceleration."""

import math
from typing import NamedTuple

from hil.core.motion.set_point import STILL, SetPoint
from hil.values.robot import JointLimits, Seven

POLE_RAD_S = 100.0
_BRAKING_SHARE = 0.9
"""Share of the acceleration that the braking curve plans with; the second pole follows the curve 8 % harder."""
_LANDING_RAD = 1e-6
"""What is left of a way is covered in one cycle; so small that no drive hears it."""


class Axis(NamedTuple):
    """What one axis is filtered with; rad, rad/s, rad/s2."""

    low: float
    high: float
    acceleration: float
    step: float
    """Most the velocity may change in one cycle."""
    landing: float
    """Distance that is covered at once, to hit the destination exactly."""
    linear: float
    """Distance from which the braking curve takes over from the slope."""
    braking: float
    """Twice the deceleration of the braking curve."""


class DirectFilter:
    """Moves seven axes, each for itself, one cycle a step.

    An axis wants the velocity slope x distance, but never more than lets it brake for the destination (the braking
    curve meets the slope without a kink) and never more than its fastest; its velocity follows with the second pole,
    never faster than its acceleration. Near the destination that is the exact discretisation of two equal poles; the
    last step hits the destination, with no more acceleration than is allowed.
    """

    def __init__(self, limits: JointLimits, *, cycle_s: float) -> None:
        self._cycle_s = cycle_s
        self._rate = 1.0 / cycle_s
        pole = math.exp(-POLE_RAD_S * cycle_s)
        self._gain = 1.0 - pole * pole
        self._slope = slope = (1.0 - pole) / ((1.0 + pole) * cycle_s)
        self._axes = tuple(
            Axis(
                low,
                high,
                acceleration,
                acceleration * cycle_s,
                min(_LANDING_RAD, acceleration * cycle_s * cycle_s),
                _BRAKING_SHARE * acceleration / (slope * slope),
                2.0 * _BRAKING_SHARE * acceleration,
            )
            for low, high, acceleration in zip(
                limits.position_min_rad, limits.position_max_rad, limits.acceleration_rad_s2, strict=True
            )
        )
        self._fastest = limits.velocity_rad_s
        self._allowed = self._fastest
        self._slow_cycles = 0
        self._held_back = False
        self._goal: Seven = STILL
        self._easy: list[tuple[float, float, float]] = []
        """Of each axis: the distances between which neither landing nor a limit matters; most the velocity changes."""
        self.set_point = SetPoint(STILL, STILL)
        self.at_goal = True

    @property
    def goal_rad(self) -> Seven:
        """Where it goes."""
        return self._goal

    def begin(self, start: SetPoint) -> None:
        """Start from ``start``; where it moves, the goal is the nearest place to stop at without turning round."""
        self.set_point = start
        goal = []
        for axis, here, velocity in zip(self._axes, start.position_rad, start.velocity_rad_s, strict=True):
            goal.append(min(max(here + self._stopping_rad(axis, velocity), axis.low), axis.high))
            # What this filter does itself always lets it stop inside the range; what it takes over may not.
            room = axis.high - here if velocity > 0.0 else here - axis.low
            self._held_back = self._held_back or velocity * velocity > axis.acceleration * room
        self._allow(self._fastest)
        self.aim(tuple(goal), minimum_time_s=0.0)  # type: ignore[arg-type]  # there are seven

    def aim(self, goal_rad: Seven, *, minimum_time_s: float) -> None:
        """Go to ``goal_rad``; until ``minimum_time_s`` is over no faster than a steady motion would take that long."""
        self._goal = goal_rad
        self.at_goal = goal_rad == self.set_point.position_rad and self.set_point.velocity_rad_s == STILL
        # Below this time the slope alone, which only falls on the way, is slower.
        if minimum_time_s * self._slope <= 1.0:
            self._slow_cycles = 0
            if self._allowed is not self._fastest:
                self._allow(self._fastest)
            return
        self._slow_cycles = math.floor(minimum_time_s * self._rate + 1e-6)
        self._allow(
            tuple(
                min(fastest, abs(there - here) / minimum_time_s)
                for fastest, there, here in zip(self._fastest, goal_rad, self.set_point.position_rad, strict=True)
            )  # type: ignore[arg-type]  # there are seven
        )

    def advance(self) -> SetPoint:
        """Return the set point of the next cycle."""
        if self._slow_cycles:
            self._slow_cycles -= 1
            if not self._slow_cycles:
                self._allow(self._fastest)
        cycle_s, rate, gain, slope = self._cycle_s, self._rate, self._gain, self._slope
        positions, velocities, accelerations = [], [], []
        settled = True
        index = -1
        for here, velocity, goal, (near, far, step) in zip(
            self.set_point.position_rad, self.set_point.velocity_rad_s, self._goal, self._easy, strict=True
        ):
            index += 1
            error = goal - here
            if error == 0.0 == velocity:
                positions.append(here)
                velocities.append(0.0)
                accelerations.append(0.0)
                continue
            change = gain * (slope * error - velocity)
            if -step <= change <= step and (near < error < far or -far < error < -near):
                after = velocity + change
                positions.append(here + after * cycle_s)
                settled = False
            else:
                after, there = self._limited(index, here, velocity, goal)
                positions.append(there)
                settled = settled and there == goal and after == 0.0
            velocities.append(after)
            accelerations.append((after - velocity) * rate)
        if settled:
            self.at_goal = True
            if self._held_back:
                self._held_back = False
                self._allow(self._allowed)
            self.set_point = SetPoint(self._goal, STILL)
        else:
            self.set_point = SetPoint(tuple(positions), tuple(velocities), tuple(accelerations))  # type: ignore[arg-type]
        return self.set_point

    def settling_s(self, goal_rad: Seven | None = None) -> float:
        """Return about how long it takes until all axes stand at the goal (or would stand at another)."""
        if goal_rad is None and self.at_goal:
            return 0.0
        goal = self._goal if goal_rad is None else goal_rad
        position, velocity, _ = self.set_point
        longest = max(map(self._axis_settling_s, self._axes, position, velocity, goal, self._fastest))
        return longest if goal_rad is not None else max(longest, self._slow_cycles * self._cycle_s)

    def _allow(self, velocity_rad_s: Seven) -> None:
        self._allowed = velocity_rad_s
        slope = self._slope
        self._easy = [
            (axis.landing, 0.0 if self._held_back else min(axis.linear, allowed / slope), axis.step)
            for axis, allowed in zip(self._axes, velocity_rad_s, strict=True)
        ]

    def _limited(self, index: int, here: float, velocity: float, goal: float) -> tuple[float, float]:
        """Return velocity and position after a cycle in which a limit matters, or the goal is hit."""
        axis, allowed = self._axes[index], self._allowed[index]
        error = goal - here
        distance, after = abs(error), error * self._rate
        if distance <= axis.landing and abs(after - velocity) <= axis.step and abs(after) <= allowed:
            return after, goal
        if distance <= axis.linear:
            wanted = self._slope * distance
        else:
            wanted = math.sqrt(axis.braking * (distance - 0.5 * axis.linear))
        change = self._gain * (math.copysign(min(wanted, allowed), error) - velocity)
        after = velocity + max(-axis.step, min(axis.step, change))
        if self._held_back:
            room = axis.high - here if velocity > 0.0 else here - axis.low
            if velocity * velocity > 2.0 * axis.acceleration * (room - abs(velocity) * self._cycle_s):
                after = _stopped_in(room, velocity, after, self._cycle_s)
        return after, here + after * self._cycle_s

    def _stopping_rad(self, axis: Axis, velocity: float) -> float:
        """Return the distance (signed as ``velocity``) at which an axis wants just this velocity."""
        speed = abs(velocity)
        if speed <= self._slope * axis.linear:
            return velocity / self._slope
        return math.copysign(speed * speed / axis.braking + 0.5 * axis.linear, velocity)

    def _axis_settling_s(self, axis: Axis, here: float, velocity: float, goal: float, fastest: float) -> float:
        """Return about how long one axis needs to turn round if it must, speed up, cruise, brake, and settle."""
        distance = abs(goal - here)
        towards = velocity if goal >= here else -velocity
        acceleration, braking = axis.acceleration, 0.5 * axis.braking
        time_s = 0.0
        to_stop = towards * abs(towards) / (2.0 * acceleration)
        if to_stop < 0.0 or to_stop > distance:
            time_s, distance, towards = abs(towards) / acceleration, abs(distance - to_stop), 0.0
        roundness = 1.0
        if distance > axis.linear:
            way, last = distance - axis.linear, self._slope * axis.linear
            squares = towards * towards / acceleration + last * last / braking
            top = min(fastest, math.sqrt((2.0 * way + squares) / (1.0 / acceleration + 1.0 / braking)))
            ramps = abs(top * top - towards * towards) / acceleration + abs(top * top - last * last) / braking
            time_s += abs(top - towards) / acceleration + max(0.0, top - last) / braking
            time_s += max(0.0, way - 0.5 * ramps) / top
            distance, roundness = axis.linear, 0.375
        # What is left shrinks with (1 + r w t) exp(-w t); r is 1 from rest and 3/8 from the braking curve.
        left = math.log(max(1.0, distance / axis.landing))
        settling = left
        for _ in range(3):
            settling = left + math.log1p(roundness * settling)
        return time_s + settling / POLE_RAD_S


def _stopped_in(room: float, velocity: float, after: float, cycle_s: float) -> float:
    """Return ``after``, or less, so that the axis stops in ``room``, if need be harder than it may."""
    if room <= 0.0:
        return 0.0
    slower = velocity * (1.0 - min(1.0, abs(velocity) * cycle_s / (2.0 * room)))
    return min(after, slower) if velocity > 0.0 else max(after, slower)
