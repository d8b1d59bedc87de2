"""What an application reads of a running servo motion: the data of its last update, and their text (manual 7.5).

The blocking and the asyncio runtimes are this, plus the calls that wait.
"""

import inspect
from collections.abc import Callable, Iterable
from typing import Final, Protocol

from hil.client.servo import _operations as operations
from hil.client.servo._operations import Operation
from hil.client.servo._runtime_text import VERBOSITY, describe
from hil.client.servo.errors import IllegalArgumentException
from hil.client.servo.motions import vector
from hil.client.servo.session import MotionRecord, Update
from hil.client.servo.statistic_timer import StatisticTimer
from hil.values.errors import OutOfRange
from hil.values.motion import MINIMUM_EXECUTION_TIME, FineInterpolatorState, MotionKind
from hil.values.servo import (
    GoalReached,
    MotionState,
    Request,
    RequestDone,
    SetDestination,
    SetRuntimeParameters,
    Vector,
)

_NS_PER_S: Final = 10**9


class IServoOnGoalReachedEvent(Protocol):
    """Who wants to hear that a destination was reached (manual 7.7)."""

    def on_goal_reached_event(self, state: str, current_axis_pos: Vector, os_timestamp: tuple[int, int]) -> None:
        """Take the event: name of the interpolator state, measured positions in rad, Unix time as (s, ns).

        The time is the controller's. It is called in the client's own thread, or task, which keeps the session alive:
        so be brief, well inside the watchdog. What it raises, the next call of the client raises.
        """


class ServoRuntime:
    """The getters read the data of the last update, and never wait; every call that waits is an update as well.

    Times are in ns on the controller's axis, which starts at 0 with its first cycle.
    """

    def __init__(self, record: MotionRecord, update: Update) -> None:
        self._record = record
        self._update = update
        self._verbosity = 1
        self._timing_update = StatisticTimer()
        self._timing_set_destination = StatisticTimer()

    def get_time_stamp_of_set_realtime_destination(self) -> int:
        """When the last destination arrived at the controller."""
        return self._update.motion.destination_at_ns

    def get_time_stamp_of_update(self) -> int:
        """When the controller sent the data of the last update."""
        return self._update.snapshot.now_ns

    def get_current_joint_destination(self) -> Vector:
        """Last destination the controller took, in rad; empty while the motion waits without one."""
        return self._update.motion.destination

    def get_fine_ipo_state(self) -> FineInterpolatorState:
        """State of the fine interpolator (manual 7.6)."""
        return self._update.motion.interpolator

    def is_destination_reached(self) -> bool:
        """Whether the interpolator has reached the last destination."""
        return self._update.motion.interpolator is not FineInterpolatorState.MOVING

    def has_fine_ipo_goal_reached(self) -> bool:
        """Whether the interpolator has reached the last destination: the same under its other name."""
        return self.is_destination_reached()

    def get_remaining_time(self) -> float:
        """Seconds until the last destination is reached, reaction time included; 0.0 when it is."""
        return self._update.motion.remaining_s

    def get_command_result_of_interpolation(self) -> Vector:
        """Set point of the interpolator in rad."""
        return self._update.snapshot.commanded_position

    def get_axis_q_msr_on_controller(self) -> Vector:
        """Measured axis positions in rad."""
        return self._update.snapshot.measured_position

    @property
    def motion_state(self) -> MotionState:
        """The motion as the last update showed it; ours, for its phase and the accounts of its destinations."""
        return self._update.motion

    def get_ext_torque_vector(self) -> Vector:
        """Axis torques the environment exerts, in Nm: positive where it pushes an axis towards plus."""
        return self._update.snapshot.external_torque

    def get_axis_tau_ext_msr(self) -> Vector:
        """The same under its other name."""
        return self.get_ext_torque_vector()

    def set_detailed_output(self, level_of_verbosity: int) -> None:
        """Choose how much ``str()`` of the runtime says: 1 (default), 2 or 3."""
        if level_of_verbosity not in VERBOSITY:
            raise OutOfRange("detailed output", level_of_verbosity, "1, 2, 3")
        self._verbosity = int(level_of_verbosity)

    def set_goal_reached_event_handler(self, handler: IServoOnGoalReachedEvent | None) -> None:
        """Tell ``handler`` each goal reached from now on; None tells nobody."""
        if handler is None:
            self._record.on_goal = None
            return
        tell = getattr(handler, "on_goal_reached_event", None)
        if not callable(tell):
            raise IllegalArgumentException(
                f"{handler!r} has no method on_goal_reached_event(state, current_axis_pos, os_timestamp)"
            )
        if inspect.iscoroutinefunction(tell):
            raise IllegalArgumentException("on_goal_reached_event is a coroutine function; a plain one is needed")
        welcome = self._record.session.welcome
        unix_epoch_ns = 0 if welcome is None else welcome.unix_epoch_ns

        def on_goal(report: GoalReached) -> None:
            tell(report.state.name, report.position, divmod(unix_epoch_ns + report.at_ns, _NS_PER_S))

        self._record.on_goal = on_goal

    def __str__(self) -> str:
        return describe(
            self._record,
            self._update,
            verbosity=self._verbosity,
            timing_update=self._timing_update,
            timing_set_destination=self._timing_set_destination,
        )

    def _updating(self) -> Operation[None]:
        step = self._timing_update.new_time_step()
        self._update = yield from operations.update(self._record)
        step.end()

    def _setting_destination(self, position: Iterable[float], velocity: Iterable[float] | None) -> Operation[int]:
        if velocity is not None and self._record.kind is MotionKind.DIRECT_SERVO:
            raise IllegalArgumentException("a DirectServo takes no target velocity, only a SmartServo does")
        position_rad = vector("destination", position)
        velocity_rad_s = None if velocity is None else vector("target velocity", velocity)
        motion = self._record.number
        steps = self._timing_set_destination.new_time_step(), self._timing_update.new_time_step()
        done = yield from self._changing(lambda number: SetDestination(number, motion, position_rad, velocity_rad_s))
        for step in reversed(steps):
            step.end()
        return done.at_ns

    def _setting_parameters(
        self,
        *,
        minimum_execution_time_s: float | None = None,
        velocity_planning: bool | None = None,
        wait_for_pause: bool | None = None,
    ) -> Operation[RequestDone]:
        for name, flag in (("velocity planning", velocity_planning), ("waiting for pause", wait_for_pause)):
            if flag is not None and not isinstance(flag, bool):
                raise IllegalArgumentException(f"{name} is {flag!r}; True or False is needed")
        if minimum_execution_time_s is not None:
            minimum_execution_time_s = MINIMUM_EXECUTION_TIME.check(minimum_execution_time_s)
        motion = self._record.number
        return self._changing(
            lambda number: SetRuntimeParameters(
                number, motion, minimum_execution_time_s, velocity_planning, wait_for_pause
            )
        )

    def _changing(self, make: Callable[[int], Request]) -> Operation[RequestDone]:
        done = yield from operations.change(self._record, make)
        # The answer came in a state packet of the cycle that took the request: that is an update.
        if self._record.shown is not None:
            self._update = self._record.shown
        return done
