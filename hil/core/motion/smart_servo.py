"""SmartServo: jerk-limited from position, velocity and acceleration to the newest destination (manual 3.1.1).

All axes arrive together (Ruckig, time-synchronised). Limits: axis velocity x velocity rel; base acceleration x
acceleration rel x override; base jerk x percent / 100. The override may name more than the drives can do; the
acceleration planned is never more than what the jerk builds up before the axis has its velocity, sqrt(velocity x jerk).

A destination with a velocity is reached with that velocity, at the end of a cycle. With velocity planning the axes go
on with it for the speed timeout, or until one must brake for the end of its range, whichever is first; without, they
brake at once. Each axis then stops as soon as it can. A velocity is refused with its destination where the axis has not
the room to get so fast before it and to stop after it; so the arm never leaves its range.
"""

import math
from enum import Enum

from hil.core.motion.application_motion import MotionBasis
from hil.core.motion.course import CoastingCourse, Course, PlannedCourse
from hil.core.motion.destinations import Destination
from hil.core.motion.fine_interpolator import Trigger, next_state
from hil.core.motion.motion_limits import SMART_SERVO_CHECKS, admissible, smart_servo_limits
from hil.core.motion.planner import Plan, TrajectoryPlanner
from hil.core.motion.servo_motion import ServoMotion
from hil.core.motion.set_point import STILL, SetPoint
from hil.core.motion.target_velocity import TargetVelocities
from hil.values.motion import ErrorReason, Fault, FineInterpolatorState, MotionKind, MotionParameters
from hil.values.pose import Pose
from hil.values.robot import JointLimits, Seven
from hil.values.servo import Vector

_S = FineInterpolatorState
_FOR_EVER_S = 1e6
"""Eleven days: longer than anybody coasts, and a number of cycles that can be counted."""


class Leg(Enum):
    """What the interpolator is about."""

    TO_GOAL = "to the destination"
    COASTING = "on with the velocity of the destination"
    STOPPING = "to a standstill"


class SmartServo(ServoMotion):
    """Plans anew, from the set point of the cycle before, whenever a destination is due.

    The destination that is under way anyway, sent once more, changes nothing; it would not arrive if its minimum
    execution time began again each time.
    """

    kind = MotionKind.SMART_SERVO
    checks = SMART_SERVO_CHECKS
    out_of_range = ErrorReason.POSITIONAL_LIMITS

    def __init__(self, parameters: MotionParameters, *, basis: MotionBasis, destination: Vector | Pose | None) -> None:
        super().__init__(parameters, basis=basis, destination=destination, dead_time_ns=basis.smart_servo_dead_time_ns)
        self._cycle_s = basis.cycle_ns * 1e-9
        self._limits: JointLimits
        self._planner: TrajectoryPlanner
        self._velocities: TargetVelocities
        self._goal: Destination
        self._course: Course | None = None
        self._leg = Leg.TO_GOAL
        self._under_way: tuple[Seven, Seven, float] | None = None
        """What the course to the goal was planned for: position, velocity, minimum time."""
        self._forecast: tuple[Destination, float] | None = None
        """The newest waiting destination, and how long the way to it will take in s."""

    def remaining_s(self, *, now_ns: int) -> float:
        """Return the time until the last destination is reached; a forecast while it waits for its dead time.

        The forecast plans from where the arm will be by then, without regard to others that wait before it.
        """
        if self._line:
            return self._forecast_s(now_ns)
        if self._course is None or self.interpolator is not _S.MOVING:
            return 0.0
        return self._course.remaining_s

    @property
    def _present(self) -> SetPoint:
        return self._set_point

    def _prepare(self) -> None:
        limits = self._limits = smart_servo_limits(self.basis, self.parameters)
        self._planner = TrajectoryPlanner(limits, cycle_s=self._cycle_s)
        self._velocities = TargetVelocities(limits)

    def _unreachable(self, goal: Destination, measured_rad: Seven) -> Fault | None:  # noqa: ARG002  # from anywhere
        return None if goal.velocity_rad_s == STILL else self._velocities.refused(goal)

    def _take_over(self, start: SetPoint, goal: Destination | None, *, now_ns: int) -> Fault | None:
        start = self._set_point = admissible(start, self._limits)
        if goal is not None:
            return self._aim(goal)
        stop = None if start.stands else self._planner.to_rest(start)
        if isinstance(stop, Fault):
            return stop
        self.destination_at_ns = now_ns
        if stop is None:
            self.destination = start.position_rad
            self._goal_reached(Trigger.GOAL_REACHED, now_ns)
        else:
            self.destination = stop.end.position_rad
            self._follow_to_rest(stop)
        return None

    def _aim(self, goal: Destination) -> Fault | None:
        wanted = (goal.position_rad, goal.velocity_rad_s, self.parameters.minimum_execution_time_s)
        if wanted == self._under_way:
            return None
        planned = self._plan(self._set_point, goal)
        if isinstance(planned, Fault):
            return planned
        self._under_way = wanted
        self._goal = goal
        self._leg = Leg.TO_GOAL
        self._course = PlannedCourse(planned, SetPoint(goal.position_rad, goal.velocity_rad_s), cycle_s=self._cycle_s)
        self._forecast = None
        return None

    def _next(self, now_ns: int) -> SetPoint | Fault:
        course = self._course
        if course is None:
            self._rest(now_ns)
            return self._set_point
        if self._leg is Leg.COASTING and (course.done or not self.parameters.velocity_planning):
            stop = self._planner.to_rest(self._set_point)
            if isinstance(stop, Fault):
                return stop
            course = self._follow_to_rest(stop)
            if self.interpolator is _S.VELOCITY_AFTER_GOAL_REACH:
                self.interpolator = next_state(self.interpolator, Trigger.SPEED_TIMEOUT)
                self._rests_since_ns = now_ns
        set_point = self._set_point = course.advance()
        if course.done and self._leg is not Leg.COASTING:
            self._arrive(now_ns)
        self._rest(now_ns)
        return set_point

    def _arrive(self, now_ns: int) -> None:
        """The end of a planned course is reached."""
        self._course = None
        self._under_way = None
        if self._leg is Leg.STOPPING:
            self.seconds_hand.stands(now_ns)
            if self.interpolator is _S.MOVING:
                self._goal_reached(Trigger.GOAL_REACHED, now_ns)
        elif self._goal.velocity_rad_s == STILL:
            self.seconds_hand.stands(now_ns)
            self._goal_reached(Trigger.GOAL_REACHED, now_ns)
        else:
            self._coast(now_ns)

    def _coast(self, now_ns: int) -> None:
        planning = self.parameters.velocity_planning
        longest_s = min(self.parameters.speed_timeout_s, self._velocities.longest_coasting_s(self._goal), _FOR_EVER_S)
        cycles = math.floor(longest_s / self._cycle_s + 1e-6) if planning else 0
        self._leg = Leg.COASTING
        self._course = CoastingCourse(self._set_point, cycles, cycle_s=self._cycle_s)
        self._goal_reached(Trigger.GOAL_REACHED_WITH_VELOCITY if planning else Trigger.GOAL_REACHED, now_ns)

    def _follow_to_rest(self, stop: Plan) -> Course:
        self._leg = Leg.STOPPING
        self._course = PlannedCourse(stop, SetPoint(stop.end.position_rad, STILL), cycle_s=self._cycle_s)
        return self._course

    def _plan(self, start: SetPoint, goal: Destination, *, any_range: bool = False) -> Plan | Fault:
        arrives_moving = goal.velocity_rad_s != STILL
        return self._planner.to_goal(
            start,
            goal.position_rad if goal.position_rad == start.position_rad else goal.planned_rad,
            velocity_rad_s=goal.velocity_rad_s,
            minimum_time_s=self.parameters.minimum_execution_time_s,
            any_range=any_range,
            margin_rad=self._velocities.margin_rad(goal) if arrives_moving else None,
        )

    def _forecast_s(self, now_ns: int) -> float:
        newest = self._line.newest
        cycles = -(-self._line.wait_ns(now_ns=now_ns) // self.basis.cycle_ns)
        ahead = max(0, cycles - 1)
        if self._forecast is None or self._forecast[0] is not newest:
            start = self._set_point if self._course is None else self._course.ahead(ahead)
            planned = self._plan(start, newest, any_range=True)
            self._forecast = newest, 0.0 if isinstance(planned, Fault) else planned.duration_s
        return ahead * self._cycle_s + self._forecast[1]
