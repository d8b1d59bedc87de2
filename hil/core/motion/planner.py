"""Trajectories from where an arm is to where it is to go, within velocity, acceleration and jerk, by Ruckig.

What Ruckig cannot plan is returned as the manual's reason (10.3); Ruckig itself answers some of it with a result and
some with an exception, and both are looked up in a table.
"""

from collections.abc import Callable, Mapping
from typing import Any, Final, Protocol

from ruckig import (
    ControlInterface,
    DurationDiscretization,
    InputParameter,
    Result,
    Ruckig,
    RuckigError,
    Synchronization,
    Trajectory,
)

from hil.core.motion.axis_range import leaves_range
from hil.core.motion.motion_limits import bad_execution_time
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.motion import ErrorReason, Fault
from hil.values.robot import JOINT_COUNT, JointLimits, Seven

RESULTS: Final[Mapping[Result, ErrorReason]] = {
    Result.Error: ErrorReason.ERROR,
    Result.ErrorInvalidInput: ErrorReason.INVALID_INPUT_VALUES,
    Result.ErrorPositionalLimits: ErrorReason.POSITIONAL_LIMITS,
    Result.ErrorExecutionTimeCalculation: ErrorReason.EXECUTION_TIME_CALCULATION,
    Result.ErrorSynchronizationCalculation: ErrorReason.SYNCHRONIZATION,
}
"""What Ruckig answers, to the manual's reason."""

EXCEPTIONS: Final = (
    ("zero limits conflict", ErrorReason.INVALID_INPUT_VALUES),
    ("error in step 1", ErrorReason.EXECUTION_TIME_CALCULATION),
    ("error in step 2", ErrorReason.SYNCHRONIZATION),
    ("error in time synchronization", ErrorReason.SYNCHRONIZATION),
    ("-101 is not a valid Result", ErrorReason.EXECUTION_TIME_TOO_BIG),
)
"""What Ruckig raises, by a part of its text, to the manual's reason; any other text is about an input value.

The Python binding lacks Ruckig's result for a duration above 7.6e3 s and fails to convert it, which is the last line.
"""

_PLANNED: Final = frozenset({Result.Working, Result.Finished})
_STRAIGHT_TOLERANCE_RAD = 1e-9
_NO_WAY_RAD = 1e-8
_BESIDE = 1.0 - 1e-9


class Solver(Protocol):
    """What the planner needs of a Ruckig; a test may bring its own."""

    def calculate(self, request: Any, trajectory: Any, /) -> Any:
        """Write the trajectory for ``request`` into ``trajectory`` and return a result, or raise."""


class Plan:
    """A trajectory that was planned; times in s from its start."""

    __slots__ = ("_at_time", "duration_s")

    def __init__(self, trajectory: Any) -> None:
        self._at_time: Callable[[float], tuple[list[float], list[float], list[float]]] = trajectory.at_time
        self.duration_s: float = trajectory.duration

    def at(self, time_s: float) -> SetPoint:
        """Return the set point at a time."""
        position, velocity, acceleration = self._at_time(time_s)
        return SetPoint(tuple(position), tuple(velocity), tuple(acceleration))  # type: ignore[arg-type]

    @property
    def end(self) -> SetPoint:
        """Where it leads to."""
        return self.at(self.duration_s)


class PlanByWayOfRest(Plan):
    """To a standstill, and on from there."""

    __slots__ = ("_from_rest", "_to_rest")

    def __init__(self, to_rest: Plan, from_rest: Plan) -> None:
        self._to_rest = to_rest
        self._from_rest = from_rest
        self.duration_s = to_rest.duration_s + from_rest.duration_s

    def at(self, time_s: float) -> SetPoint:
        """Return the set point at a time."""
        left_s = time_s - self._to_rest.duration_s
        return self._to_rest.at(time_s) if left_s < 0.0 else self._from_rest.at(left_s)


class TrajectoryPlanner:
    """Plans within ``limits``; one for each motion, because what it works on is used again each time.

    Ruckig meets a goal to 1e-8 rad: whoever follows a plan makes that good at its end, and plans to no place that is
    nearer than that to the end of a range. Start accelerations must be admissible
    (:func:`hil.core.motion.motion_limits.admissible`).
    """

    def __init__(self, limits: JointLimits, *, cycle_s: float, solver: Solver | None = None) -> None:
        self._limits = limits
        self._solver: Solver = Ruckig(JOINT_COUNT, cycle_s) if solver is None else solver
        self._to_goal = self._request()
        self._to_rest: InputParameter | None = None

    def to_goal(
        self,
        start: SetPoint,
        goal_rad: Seven,
        *,
        velocity_rad_s: Seven = STILL,
        minimum_time_s: float = 0.0,
        any_range: bool = False,
        margin_rad: Seven | None = None,
    ) -> Plan | Fault:
        """Plan a way to ``goal_rad`` on which all axes arrive together, with ``velocity_rad_s``.

        Ruckig's ways may turn round behind their end, although the axis could stop before it. If one leaves an axis
        range, or the axes cannot be synchronised, every axis goes as quickly as it can; if that leaves it too, the arm
        comes to rest first. Neither is a way out where axes have to arrive with a velocity. A way with a velocity at
        its end takes whole cycles, so that it is reached at the end of one. ``any_range`` spares the look at the range
        (it keeps ``margin_rad`` to it).
        """
        fault = bad_execution_time(minimum_time_s)
        if fault is not None:
            return fault
        request = self._to_goal
        arrives_moving = velocity_rad_s != STILL
        request.current_position, request.current_velocity, request.current_acceleration = start
        request.target_position = goal_rad
        request.target_velocity = velocity_rad_s
        request.minimum_duration = minimum_time_s
        if arrives_moving:
            request.duration_discretization = DurationDiscretization.Discrete
        planned = self._plan(request, None if any_range else start, margin_rad)
        if arrives_moving:
            request.duration_discretization = DurationDiscretization.Continuous
        elif isinstance(planned, Fault) and planned.reason in _WITHOUT_SYNCHRONIZATION:
            request.synchronization = Synchronization.No
            planned = self._plan(request, start, margin_rad)
            request.synchronization = Synchronization.Time
            if isinstance(planned, Fault) and not start.stands:
                return self._by_way_of_rest(start, goal_rad, minimum_time_s) or planned
        return planned

    def along_line(self, start: SetPoint, goal_rad: Seven) -> Plan | Fault:
        """Plan the straight line in axis space from rest to rest.

        Each axis gets the share of its limits that the axis with the most to do leaves it, so that all have the same
        profile, and the time is that of the slowest.
        """
        way = [_way(here, there) for here, there in zip(start.position_rad, goal_rad, strict=True)]
        if not any(way):
            return self.to_goal(start, goal_rad, any_range=True)
        request = self._request()
        request.synchronization = Synchronization.Phase
        request.max_velocity = _shared(self._limits.velocity_rad_s, way)
        request.max_acceleration = _shared(self._limits.acceleration_rad_s2, way)
        request.max_jerk = _shared(self._limits.jerk_rad_s3, way)
        request.current_position = start.position_rad
        request.target_position = [here + part for here, part in zip(start.position_rad, way, strict=True)]
        planned = self._plan(request, None, None)
        return planned if isinstance(planned, Fault) else _straight(planned, start.position_rad, way) or planned

    def to_rest(self, start: SetPoint) -> Plan | Fault:
        """Plan the shortest way to a standstill, every axis for itself."""
        request = self._to_rest
        if request is None:
            request = self._to_rest = self._request()
            request.control_interface = ControlInterface.Velocity
            request.synchronization = Synchronization.No
        request.current_position, request.current_velocity, request.current_acceleration = start
        return self._plan(request, start, None)

    def _by_way_of_rest(self, start: SetPoint, goal_rad: Seven, minimum_time_s: float) -> Plan | None:
        stop = self.to_rest(start)
        if isinstance(stop, Fault):
            return None
        left_s = max(0.0, minimum_time_s - stop.duration_s)
        on = self.to_goal(SetPoint(stop.end.position_rad, STILL), goal_rad, minimum_time_s=left_s)
        return None if isinstance(on, Fault) else PlanByWayOfRest(stop, on)

    def _plan(self, request: InputParameter, start: SetPoint | None, margin_rad: Seven | None) -> Plan | Fault:
        """Solve ``request``; with a ``start``, look at the axis ranges."""
        trajectory = Trajectory(JOINT_COUNT)
        fault = self._solve(request, trajectory)
        if fault is not None and fault.reason is ErrorReason.EXECUTION_TIME_CALCULATION:
            # Ruckig misses the profile of an axis for single inputs, and finds it for those beside them.
            request.current_acceleration = [_BESIDE * value for value in request.current_acceleration]
            fault = self._solve(request, trajectory) and fault
        if fault is not None:
            return fault
        plan = Plan(trajectory)
        if start is None:
            return plan
        end = plan.end.position_rad
        return leaves_range(trajectory, start, end, limits=self._limits, margin_rad=margin_rad) or plan

    def _solve(self, request: InputParameter, trajectory: Any) -> Fault | None:
        try:
            result = self._solver.calculate(request, trajectory)
        except (RuckigError, ValueError) as error:
            return _fault_of(error)
        if result in _PLANNED:
            return None
        return Fault(RESULTS.get(result, ErrorReason.ERROR), f"the planner answers {result!s}")

    def _request(self) -> InputParameter:
        request = InputParameter(JOINT_COUNT)
        request.max_velocity = self._limits.velocity_rad_s
        request.max_acceleration = self._limits.acceleration_rad_s2
        request.max_jerk = self._limits.jerk_rad_s3
        return request


_WITHOUT_SYNCHRONIZATION: Final = frozenset({ErrorReason.POSITIONAL_LIMITS, ErrorReason.SYNCHRONIZATION})
"""Reasons that each axis going for itself may not have."""


def _fault_of(error: Exception) -> Fault:
    text = str(error).strip()
    first_line = text.partition("\n")[0]
    for part, reason in EXCEPTIONS:
        if part in text:
            return Fault(reason, f"the planner answers: {first_line}")
    known = ErrorReason.INVALID_INPUT_VALUES if isinstance(error, RuckigError) else ErrorReason.ERROR
    return Fault(known, f"the planner answers: {first_line}")


def _way(here_rad: float, there_rad: float) -> float:
    """Return the way of one axis; what is shorter than Ruckig's precision is none."""
    way_rad = there_rad - here_rad
    return way_rad if abs(way_rad) > _NO_WAY_RAD else 0.0


def _shared(limits: Seven, way: list[float]) -> list[float]:
    """Return the limit of each axis times its share of the way of the axis whose limit binds."""
    share = min(limit / abs(part) for limit, part in zip(limits, way, strict=True) if part)
    return [share * abs(part) if part else limit for limit, part in zip(limits, way, strict=True)]


def _straight(plan: Plan, start_rad: Seven, way: list[float]) -> Fault | None:
    """Return a fault if the arm is beside its line in the middle of the time."""
    longest = max(range(JOINT_COUNT), key=lambda axis: abs(way[axis]))
    middle = plan.at(plan.duration_s / 2).position_rad
    share = (middle[longest] - start_rad[longest]) / way[longest]
    off = max(abs(here + share * part - there) for here, part, there in zip(start_rad, way, middle, strict=True))
    if off <= _STRAIGHT_TOLERANCE_RAD:
        return None
    return Fault(ErrorReason.NO_PHASE_SYNCHRONIZATION, f"an axis would be {off:.3g} rad beside the straight line")
