"""The axis positions of a flange pose that are nearest to the present ones: which branch, which E1.

*Near* is measured by the largest change of an axis. The present E1 and the present branch are kept where they give an
answer, because an application that moves its flange does not expect the elbow to swing. That answer is refused in one
case: the axes would have to change much more than the pose does, as beside A6 = 0 with E1 held. Then, and where there
is none, other E1 are looked at, in all branches:

1. those that hold another axis than A3: A1 with the wrist centre overhead, A5 with the wrist stretched. Beside these
   two singularities the answer is a narrow valley, and so it is hit exactly. A small change that fits the pose's ends
   the search.
2. outwards from the present E1 to both sides, in steps that grow from a tenth of the change of pose up to
   ``_WIDEST_STEP_RAD``. E1 itself is an axis, so no E1 farther away than the best change found can be better: there
   the search ends, soon in most cases, and at the limits of A3 in the worst.
3. by golden section between the neighbours of the best valleys so far, at most ``_VALLEYS``.

So the work is bounded. What is found is the best up to the width of a step: a range of E1 within the axis limits that
is narrower than one can be missed.
"""

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Final, NamedTuple

from hil.core.kinematics.answers import NoPosition
from hil.core.kinematics.srs import ELBOW, SrsKinematics, WristTarget, other_wrist
from hil.values.pose import Pose
from hil.values.robot import Seven

_WELL_CONDITIONED: Final = 4.0
"""Largest change of an axis for a change of pose, rad per rad, that a kept E1 may cost."""

_SHORT_WAY_RAD: Final = 0.3
"""Change up to which an answer that fits the change of pose ends the search; a longer way is worth a longer look."""

_SAME_POSE: Final = 1e-7
"""Change of pose, and of axes, below which rounding (beside A4 = 0 its root) makes the ratio of the two meaningless."""

_STANDING: Final = 1e-12
"""Change of pose that is none: in a singularity the axes would make something of its rounding."""

_FIRST_STEP: Final = 0.1
_GROWTH: Final = 1.6
_WIDEST_STEP_RAD: Final = 0.1
_VALLEYS: Final = 3
_SECTIONS: Final = 14
_SECANTS: Final = 5
_SECTION: Final = (3.0 - math.sqrt(5.0)) / 2.0
"""The golden section's smaller part."""


_Arm = tuple[bool, bool]
"""Overhead and elbow, the two bits of Status that are not the wrist's."""


class _Found(NamedTuple):
    """The answer of one arm at one E1; ``change_rad`` is infinite where there is none."""

    change_rad: float
    e1_rad: float
    position_rad: Seven | None
    arm: _Arm


def nearest(kinematics: SrsKinematics, flange_in_base: Pose, present_rad: Seven) -> Seven | NoPosition:
    """Return the axis positions of a pose nearest to ``present_rad``, or why there are none in its branch at its E1."""
    moved = _change_of_pose(kinematics, kinematics.forward(present_rad), flange_in_base)
    if moved <= _STANDING:
        return present_rad
    kept = kinematics.inverse(flange_in_base, present_rad[2], kinematics.status_of(present_rad), near_rad=present_rad)
    enough = _WELL_CONDITIONED * max(moved, _SAME_POSE)
    change = math.inf if isinstance(kept, NoPosition) else largest_change_rad(kept, present_rad)
    if change <= enough:
        return kept
    target = kinematics.wrist_target(flange_in_base)
    if isinstance(target, NoPosition) or target.a4 > kinematics.largest_a4_rad:
        return kept
    found = _Search(kinematics, target, present_rad).best(max(moved, _SAME_POSE), min(enough, _SHORT_WAY_RAD))
    return kept if found.position_rad is None or found.change_rad >= change else found.position_rad


def largest_change_rad(position_rad: Seven, present_rad: Seven) -> float:
    """Return how far the axis that has to go farthest has to go."""
    a1, a2, a3, a4, a5, a6, a7 = position_rad
    b1, b2, b3, b4, b5, b6, b7 = present_rad
    return max(abs(a1 - b1), abs(a2 - b2), abs(a3 - b3), abs(a4 - b4), abs(a5 - b5), abs(a6 - b6), abs(a7 - b7))


def _change_of_pose(kinematics: SrsKinematics, before: Pose, after: Pose) -> float:
    """Return the change of a pose as an angle: its rotation, and its translation seen from a forearm away."""
    return before.angle_rad(after) + before.distance_m(after) / kinematics.lengths.d5_m


class _Search:
    """One search of E1 for one target."""

    def __init__(self, kinematics: SrsKinematics, target: WristTarget, present_rad: Seven) -> None:
        self._kinematics, self._target, self._present = kinematics, target, present_rad
        self._low_rad, self._high_rad = kinematics.limits.position_min_rad[2], kinematics.limits.position_max_rad[2]
        elbow = kinematics.status_of(present_rad) & ELBOW != 0
        self._same_elbow: tuple[_Arm, ...] = ((False, elbow), (True, elbow))
        self._both_elbows: tuple[_Arm, ...] = (*self._same_elbow, (False, not elbow), (True, not elbow))
        self._nothing = _Found(math.inf, present_rad[2], None, self._same_elbow[0])
        # A4 is the same for every E1, so turning the elbow over costs this much, whatever the rest.
        self._elbow_change_rad = target.a4 + abs(present_rad[3])

    def best(self, moved: float, enough_rad: float) -> _Found:
        """Return the best answer; after a change of at most ``enough_rad`` no further valley is looked into."""
        first_step_rad = min(_FIRST_STEP * moved, _WIDEST_STEP_RAD)
        seen: list[_Found] = []
        best = self._nothing
        for e1_rad in self._with_an_axis_kept(first_step_rad):
            if self._low_rad <= e1_rad <= self._high_rad:
                seen += [self._at(e1_rad, arm) for arm in self._both_elbows]
                best = min(seen, key=_change)
                if best.change_rad <= enough_rad:
                    return best
        seen += self._scan(first_step_rad, best)
        best = min(seen, key=_change)
        for middle, left_rad, right_rad in self._valleys(seen)[:_VALLEYS]:
            best = min(best, self._refined(middle, left_rad, right_rad), key=_change)
            if best.change_rad <= enough_rad:
                break
        return best

    def _valleys(self, seen: list[_Found]) -> list[tuple[_Found, float, float]]:
        """Return the local minima along E1 of each arm with the E1 of their neighbours, the lowest first."""
        valleys: list[tuple[_Found, float, float]] = []
        for arm in self._both_elbows:
            line = sorted((found for found in seen if found.arm == arm), key=_e1)
            valleys += [
                (middle, left.e1_rad, right.e1_rad)
                for left, middle, right in zip((*line[:1], *line), line, (*line[1:], *line[-1:]), strict=False)
                if middle.position_rad is not None and left.change_rad >= middle.change_rad <= right.change_rad
            ]
        return sorted(valleys, key=lambda valley: valley[0].change_rad)

    def _with_an_axis_kept(self, first_step_rad: float) -> Iterator[float]:
        """Yield the E1 near the present one that leave A1 where it is, or A5 but for half a turn.

        A1 in closed form. A5 by secants on how far the flange's z axis leans out of the plane in which A6 would turn
        it: that is smooth in E1, where A5 itself is not; and smooth in A1 where it is not so in E1, with x next to 0.
        """
        a1, e1 = self._present[0], self._present[2]
        yield self._e1_and_arm(a1)[0]
        for arm in self._same_elbow:
            yield _root(partial(self._lean, arm=arm), e1, first_step_rad)
        yield self._e1_and_arm(_root(lambda a1_rad: self._lean(*self._e1_and_arm(a1_rad)), a1, first_step_rad))[0]

    def _e1_and_arm(self, a1_rad: float) -> tuple[float, _Arm]:
        """Return the E1 and the arm that have A1 there, E1 on the present one's side of a quarter turn; NaN if none.

        The elbow then leads the wrist as far aside as the target is in the frame turned by A1.
        """
        target, elbow = self._target, self._same_elbow[0][1]
        sin, cos = math.sin(a1_rad), math.cos(a1_rad)
        arm = (cos * target.x + sin * target.y < 0.0, elbow)
        aside = sin * target.x - cos * target.y
        lever = self._kinematics.lengths.d5_m * (-target.sin_a4 if elbow else target.sin_a4)
        if not abs(aside) < abs(lever):
            return math.nan, arm
        e1 = math.asin(aside / lever)
        return (e1 if math.cos(self._present[2]) >= 0.0 else math.copysign(math.pi, e1) - e1), arm

    def _lean(self, e1_rad: float, arm: _Arm) -> float:
        """Return the sine of that angle; NaN where the arm has no such E1."""
        up = self._kinematics.wrist_up(self._target, e1_rad, overhead=arm[0], elbow=arm[1], near=self._present)
        return math.nan if isinstance(up, NoPosition) else math.sin(up[5]) * math.sin(up[4] - self._present[4])

    def _scan(self, first_step_rad: float, best: _Found) -> list[_Found]:
        """Return the answers at and on both sides of the present E1; ``best`` is the best so far."""
        start = self._present[2]
        found = [self._at(start, arm) for arm in self._both_elbows]
        best = min(best, *found, key=_change)
        offset = first_step_rad
        while offset < best.change_rad and (start - offset >= self._low_rad or start + offset <= self._high_rad):
            arms = self._both_elbows if self._elbow_change_rad < best.change_rad else self._same_elbow
            for e1_rad in (start - offset, start + offset):
                if self._low_rad <= e1_rad <= self._high_rad:
                    found += [self._at(e1_rad, arm) for arm in arms]
                    best = min(best, *found[-len(arms) :], key=_change)
            offset = min(offset * _GROWTH, offset + _WIDEST_STEP_RAD)
        return found

    def _refined(self, middle: _Found, left_rad: float, right_rad: float) -> _Found:
        """Return the bottom of a valley by golden section from the inside, which no edge of the limits can mislead."""
        for _ in range(_SECTIONS):
            to_left, to_right = middle.e1_rad - left_rad, right_rad - middle.e1_rad
            step = -_SECTION * to_left if to_left > to_right else _SECTION * to_right
            tried = self._at(middle.e1_rad + step, middle.arm)
            worse = middle if tried.change_rad < middle.change_rad else tried
            if tried is not worse:
                left_rad, right_rad = (left_rad, worse.e1_rad) if step < 0.0 else (worse.e1_rad, right_rad)
                middle = tried
            elif step < 0.0:
                left_rad = worse.e1_rad
            else:
                right_rad = worse.e1_rad
        return middle

    def _at(self, e1_rad: float, arm: _Arm) -> _Found:
        """Return the better answer of one arm at one E1, of the two its wrist has."""
        kinematics, present = self._kinematics, self._present
        best = _Found(math.inf, e1_rad, None, arm)
        up = kinematics.wrist_up(self._target, e1_rad, overhead=arm[0], elbow=arm[1], near=present)
        if isinstance(up, NoPosition):
            return best
        for position in (up, other_wrist(up)):
            if kinematics.inside(position):
                change = largest_change_rad(position, present)
                if change < best.change_rad:
                    best = _Found(change, e1_rad, position, arm)
        return best


def _change(found: _Found) -> float:
    return found.change_rad


def _e1(found: _Found) -> float:
    return found.e1_rad


def _root(function: Callable[[float], float], start: float, step: float) -> float:
    """Return where the secants of a function lead from ``start``; any number, NaN too, where they lead nowhere."""
    before, here = start, start + step
    value_before, value = function(before), function(here)
    for _ in range(_SECANTS):
        if not abs(value - value_before) > 0.0:
            break
        before, here = here, here - value * (here - before) / (value - value_before)
        if not abs(here) <= math.pi:
            break
        value_before, value = value, function(here)
    return here
