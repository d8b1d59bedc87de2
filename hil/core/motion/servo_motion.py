"""What SmartServo and DirectServo have in common: destinations and their dead time, states, timeouts, accounts.

When a destination is taken, the fine interpolator is ``MOVING`` at once (manual 7.6: with a new destination it jumps to
that state), though it has the destination only after the dead time. From then on the goal is the new one: to arrive at
an older one in the meantime is not to reach the goal (7.3: the old destination is discarded), and the motion does not
end while a destination waits.
"""

from abc import abstractmethod

from hil.core.diagnosis.seconds_hand import SecondsHand
from hil.core.motion.application_motion import Accounting, ApplicationMotion, MotionBasis
from hil.core.motion.destination_account import LONGEST_SECTION_NS, DestinationAccount
from hil.core.motion.destinations import Destination, DestinationLine, destination, not_well_formed
from hil.core.motion.fine_interpolator import Trigger, next_state
from hil.core.motion.motion_limits import Checks, bad_execution_time, bad_parameter
from hil.core.motion.set_point import SetPoint
from hil.values.motion import ErrorReason, Fault, FineInterpolatorState, MotionParameters
from hil.values.pose import Pose
from hil.values.robot import JOINT_COUNT, Seven
from hil.values.servo import Vector
from hil.values.tuples import new_tuple


class ServoMotion(ApplicationMotion):
    """A motion whose destination changes while it runs.

    A destination set before :meth:`begin` replaces the one the motion was made with; the motion has whichever it is in
    its first cycle, without dead time. :meth:`set_destination` changes nothing when it returns a fault.
    """

    checks: Checks
    takes_velocity = True
    account: DestinationAccount
    seconds_hand: SecondsHand

    def __init__(
        self, parameters: MotionParameters, *, basis: MotionBasis, destination: Vector | Pose | None, dead_time_ns: int
    ) -> None:
        super().__init__(parameters, basis=basis, destination=destination)
        if destination is not None:
            self.accounting = Accounting(received=1)
            if not isinstance(destination, Pose) and len(destination) == JOINT_COUNT:
                self.destination = tuple(destination)  # type: ignore[assignment]
        self.account = DestinationAccount()
        self.seconds_hand = SecondsHand()
        self._line = DestinationLine(dead_time_ns)
        self._first_goal: Destination | None = None
        self._begun = False
        self._set_point: SetPoint
        self._rests_since_ns = 0
        self._timeout_ns = parameters.timeout_after_goal_s * 1e9

    @property
    def ended(self) -> bool:
        """Whether it rested for its timeout."""
        return self.interpolator is FineInterpolatorState.ENDED

    def begin(self, start: SetPoint, *, measured_rad: Seven, now_ns: int) -> Fault | None:
        """Take over from ``start``; without a destination stop where that is soonest possible, and rest there."""
        fault = bad_parameter(self.parameters, self.checks)
        if fault is not None:
            return fault
        goal = self._first_goal
        first = self.first_destination(start) if goal is None else None
        if isinstance(first, Fault):
            return first
        if first is not None:
            fault = not_well_formed(first, None)
            if fault is not None:
                return fault
            made = self._destination(first, None, now_ns)
            if isinstance(made, Fault):
                return made
            goal = made
        self._begun = True
        self._prepare()
        if goal is not None:
            fault = self._unreachable(goal, measured_rad)
            if fault is not None:
                return fault
            self.destination, self.destination_at_ns = goal.position_rad, goal.arrived_ns
            self.accounting = self.accounting._replace(executed=1, executed_at_ns=now_ns)
            self.account.stream_begins(now_ns)
            self.seconds_hand.next_destination(goal.position_rad, goal.arrived_ns, start, now_ns - self.basis.cycle_ns)
        return self._take_over(start, goal, now_ns=now_ns)

    def set_destination(
        self, position: Vector | None, velocity: Vector | None, *, measured_rad: Seven, arrived_ns: int
    ) -> Fault | None:
        """Take a new destination; the newest of several that are due in the same cycle is the one that counts."""
        fault = not_well_formed(position, velocity)
        if fault is not None or position is None:
            return fault
        if velocity is not None and not self.takes_velocity:
            return Fault(ErrorReason.INVALID_INPUT_VALUES, "only SmartServo takes a target velocity")
        goal = self._destination(position, velocity, arrived_ns)
        if isinstance(goal, Fault):
            return goal
        if self._begun:
            fault = self._unreachable(goal, measured_rad)
            if fault is not None:
                return fault
            self._count_received(superseded=int(self._line.add(goal)))
            if self.interpolator is not FineInterpolatorState.MOVING:
                self.interpolator = next_state(self.interpolator, Trigger.DESTINATION_SET)
        else:
            self._count_received(superseded=self.accounting.received - self.accounting.superseded)
            self._first_goal = goal
        self.destination, self.destination_at_ns = goal.position_rad, arrived_ns
        return None

    def set_runtime_parameters(
        self,
        *,
        minimum_execution_time_s: float | None,
        velocity_planning: bool | None,
        wait_for_pause: bool | None,
    ) -> Fault | None:
        """Change what may change while the motion runs; a new execution time counts from the next destination on."""
        if minimum_execution_time_s is not None:
            fault = bad_execution_time(minimum_execution_time_s)
            if fault is not None:
                return fault
        return super().set_runtime_parameters(
            minimum_execution_time_s=minimum_execution_time_s,
            velocity_planning=velocity_planning,
            wait_for_pause=wait_for_pause,
        )

    def interpolate(self, *, now_ns: int, started_ns: int) -> SetPoint | Fault:
        """Return the set point of this cycle, the first of a new trajectory when a destination is due in it."""
        if self._line:
            due = self._line.due(now_ns=now_ns)
            if due is not None:
                goal, skipped = due
                arrived_ns = goal.arrived_ns
                self.account.executed(age_ns=started_ns - arrived_ns)
                if now_ns > self.seconds_hand.looks_from_ns:
                    self.seconds_hand.next_destination(
                        goal.position_rad, arrived_ns, self._present, now_ns - self.basis.cycle_ns
                    )
                fault = self._aim(goal)
                if fault is not None:
                    return fault
                received, superseded, executed, before_ns = self.accounting
                if started_ns - before_ns > LONGEST_SECTION_NS or not executed:
                    self.account.stream_begins(started_ns, before_ns=before_ns)
                self.accounting = new_tuple(Accounting, (received, superseded + skipped, executed + 1, started_ns))
        return self._next(now_ns)

    def resumed(self, *, paused_ns: int) -> None:
        """The motion was paused so long: its timeouts did not run."""
        self._rests_since_ns += paused_ns
        self.seconds_hand.begins_anew()

    @property
    @abstractmethod
    def _present(self) -> SetPoint:
        """The set point of the cycle before."""

    @abstractmethod
    def _prepare(self) -> None:
        """Work out what the parameters, which are checked, make of the limits."""

    @abstractmethod
    def _unreachable(self, goal: Destination, measured_rad: Seven) -> Fault | None:
        """Return why ``goal`` cannot be a destination now, or None."""

    @abstractmethod
    def _take_over(self, start: SetPoint, goal: Destination | None, *, now_ns: int) -> Fault | None:
        """Begin at ``start``."""

    @abstractmethod
    def _aim(self, goal: Destination) -> Fault | None:
        """Go for ``goal`` from the set point of the cycle before."""

    @abstractmethod
    def _next(self, now_ns: int) -> SetPoint | Fault:
        """Return the set point of this cycle."""

    def _destination(self, position: Vector, velocity: Vector | None, arrived_ns: int) -> Destination | Fault:
        return destination(
            position, velocity, arrived_ns=arrived_ns, limits=self.basis.limits, out_of_range=self.out_of_range
        )

    def _goal_reached(self, trigger: Trigger, now_ns: int) -> None:
        """The destination is reached, unless a newer one is on its way; a stop at a take-over is no destination."""
        if self._line:
            return
        if self.accounting.executed:
            self.goals_reached += 1
        self.interpolator = next_state(self.interpolator, trigger)
        self._rests_since_ns = now_ns

    def _rest(self, now_ns: int) -> None:
        """End the motion when it has rested for its timeout."""
        if self.interpolator is FineInterpolatorState.RESTING and now_ns - self._rests_since_ns >= self._timeout_ns:
            self.interpolator = next_state(self.interpolator, Trigger.TIMEOUT_AFTER_GOAL)

    def _count_received(self, *, superseded: int) -> None:
        received, before, executed, executed_at_ns = self.accounting
        self.accounting = new_tuple(Accounting, (received + 1, before + superseded, executed, executed_at_ns))
