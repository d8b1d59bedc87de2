"""PTP in axis space, jerk-limited: every point is addressed (manual 3.1.1).

From rest the arm goes in a straight line in axis space, all axes with the same profile. From a moving set point, where
the PTP before was blended or another motion was stopped, all axes arrive together and the way is curved. A blended PTP
may be left early, for the next one, once it has less than its share of the way before it; that one then begins moving.
In T1 a PTP is planned slow enough for the flange, is not blended, and stops before it begins if it begins moving.
"""

from hil.core.motion.application_motion import Accounting, ApplicationMotion, MotionBasis
from hil.core.motion.brake import Brake
from hil.core.motion.course import PlannedCourse
from hil.core.motion.destinations import Destination, destination, not_well_formed
from hil.core.motion.fine_interpolator import Trigger, next_state
from hil.core.motion.motion_limits import POINT_TO_POINT_CHECKS, admissible, bad_parameter, point_to_point_limits
from hil.core.motion.planner import Plan, TrajectoryPlanner
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.motion import ErrorReason, Fault, FineInterpolatorState, MotionKind, MotionParameters
from hil.values.pose import Pose
from hil.values.robot import JOINT_COUNT, Seven
from hil.values.servo import Vector

TAKES_NO_DESTINATION = Fault("a PTP takes no new destination while it runs")


class PointToPoint(ApplicationMotion):
    """Goes to its point and is over."""

    kind = MotionKind.PTP
    out_of_range = ErrorReason.POSITIONAL_LIMITS

    def __init__(self, parameters: MotionParameters, *, basis: MotionBasis, destination: Vector | Pose | None) -> None:
        super().__init__(parameters, basis=basis, destination=destination)
        if destination is not None:
            self.accounting = Accounting(received=1)
            if not isinstance(destination, Pose) and len(destination) == JOINT_COUNT:
                self.destination = tuple(destination)  # type: ignore[assignment]
        self._cycle_s = basis.cycle_ns * 1e-9
        self._course: PlannedCourse
        self._brake: Brake | None = None
        self._set_point: SetPoint
        self._way_rad = 0.0
        self._longest_axis = 0

    @property
    def ended(self) -> bool:
        """Whether the point is reached."""
        return self.interpolator is FineInterpolatorState.ENDED

    def begin(self, start: SetPoint, *, measured_rad: Seven, now_ns: int) -> Fault | None:  # noqa: ARG002  # set points
        """Plan the way from ``start``; a PTP without a point is a null pointer."""
        fault = bad_parameter(self.parameters, POINT_TO_POINT_CHECKS)
        first = self.first_destination(start)
        if isinstance(first, Fault):
            return fault or first
        fault = fault or not_well_formed(first, None)
        if fault is not None or first is None:
            return fault
        point = destination(first, None, arrived_ns=now_ns, limits=self.basis.limits, out_of_range=self.out_of_range)
        if isinstance(point, Fault):
            return point
        begins = self._brakes_first(start)
        planned = self._plan(begins, point)
        if isinstance(planned, Fault):
            return planned
        self.destination, self.destination_at_ns = point.position_rad, now_ns
        self.accounting = self.accounting._replace(executed=1, executed_at_ns=now_ns)
        self._course = PlannedCourse(planned, SetPoint(point.position_rad, STILL), cycle_s=self._cycle_s)
        self._set_point = start
        ways = [abs(there - here) for here, there in zip(begins.position_rad, point.position_rad, strict=True)]
        self._way_rad = max(ways)
        self._longest_axis = ways.index(self._way_rad)
        return None

    def set_destination(
        self,
        position: Vector | None,  # noqa: ARG002
        velocity: Vector | None,  # noqa: ARG002
        *,
        measured_rad: Seven,  # noqa: ARG002
        arrived_ns: int,  # noqa: ARG002
    ) -> Fault | None:
        """Refuse it: the way of a PTP stays what it is."""
        return TAKES_NO_DESTINATION

    def interpolate(self, *, now_ns: int, started_ns: int) -> SetPoint | Fault:  # noqa: ARG002  # it is cycles that count
        """Return the set point of this cycle."""
        if self.ended:
            return self._set_point
        if self._brake is not None:
            self._set_point = self._brake.interpolate()
            self._brake = None if self._brake.at_rest else self._brake
            return self._set_point
        self._set_point = self._course.advance()
        if self._course.done:
            self.goals_reached = 1
            self.interpolator = next_state(self.interpolator, Trigger.GOAL_REACHED)
            self.interpolator = next_state(self.interpolator, Trigger.TIMEOUT_AFTER_GOAL)
        return self._set_point

    def remaining_s(self, *, now_ns: int) -> float:  # noqa: ARG002
        """Return the time until the point is reached."""
        if self.ended:
            return 0.0
        return self._course.remaining_s + (0.0 if self._brake is None else self._brake.remaining_s)

    def blend_begins(self, *, now_ns: int) -> bool:  # noqa: ARG002  # it is the way that counts
        """Whether the axis with the longest way has less than the blended share of it left."""
        if self.parameters.blending_rel == 0.0 or self.destination is None or self._way_rad == 0.0:
            return False
        # A way that begins at the speed limit in another direction would be over it before it could slow down.
        if self.basis.flange.limit_mm_s is not None:
            return False
        left = abs(self.destination[self._longest_axis] - self._set_point.position_rad[self._longest_axis])
        return left < self.parameters.blending_rel * self._way_rad

    def _brakes_first(self, start: SetPoint) -> SetPoint:
        """Return where the way begins: in T1 at rest, because no way from a moving start is sure to be slow enough."""
        if self.basis.flange.limit_mm_s is None or start.stands:
            return start
        self._brake = Brake(start, limits=self.basis.limits, cycle_s=self._cycle_s)
        return SetPoint(self._brake.end_rad, STILL)

    def _plan(self, start: SetPoint, point: Destination) -> Plan | Fault:
        limits = point_to_point_limits(self.basis, self.parameters)
        if start.stands:
            limits = self.basis.flange.straight(start.position_rad, point.planned_rad, limits)
            return TrajectoryPlanner(limits, cycle_s=self._cycle_s).along_line(start, point.planned_rad)
        return TrajectoryPlanner(limits, cycle_s=self._cycle_s).to_goal(admissible(start, limits), point.planned_rad)
