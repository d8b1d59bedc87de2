"""What an application reads of a running servo motion: the data of its last update, and their text (manual 7.5).

The blocking and the asyncio runtimes are this, plus the calls that wait.
"""

import inspect
from collections.abc import Callable, Iterable
from enum import Enum
from typing import Final, Protocol, TypeAlias

from hil.client.servo import _frames as frames
from hil.client.servo import _operations as operations
from hil.client.servo._frames import FrameName, Moved
from hil.client.servo._operations import Operation
from hil.client.servo._runtime_text import VERBOSITY, describe
from hil.client.servo._set_point_accounting import SetPointAccounting, accounting_of
from hil.client.servo.errors import IllegalArgumentException
from hil.client.servo.motions import control_mode, vector
from hil.client.servo.session import MotionRecord, Update
from hil.client.servo.statistic_timer import StatisticTimer
from hil.values.control import ControlModeSettings
from hil.values.errors import OutOfRange
from hil.values.frames import BASE, FrameTree
from hil.values.fri import ControlMode
from hil.values.motion import MINIMUM_EXECUTION_TIME, FineInterpolatorState, MotionKind
from hil.values.pose import Pose
from hil.values.servo import (
    ChangeControlMode,
    GoalReached,
    MotionState,
    Request,
    RequestDone,
    SetDestination,
    SetRuntimeParameters,
    Vector,
)

_NS_PER_S: Final = 10**9


class _Unsaid(Enum):
    """That an argument was left out, where None is an argument that is refused."""

    UNSAID = "unsaid"


UNSAID: Final = _Unsaid.UNSAID
VelocityOrReference: TypeAlias = Iterable[float] | FrameName | _Unsaid | None
"""What may come after a destination."""


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
        self._tree = record.session.frames or FrameTree()
        self._located: tuple[Vector, Pose] | None = None
        """Where the flange is at the axis positions asked about last."""
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

    def get_current_cartesian_position(self, frame_on_flange: Moved, reference: FrameName = BASE) -> Pose:
        """Measured pose of ``frame_on_flange`` in ``reference``, by default the robot base.

        Raises :class:`IllegalArgumentException` where the one does not move with the flange, or the other does
        (manual 10.2).
        """
        moved, base = frames.in_flange(self._tree, frame_on_flange), frames.in_base(self._tree, reference)
        return base.inverse() @ self._update.snapshot.flange_in_base @ moved

    @property
    def motion_state(self) -> MotionState:
        """The motion as the last update showed it; ours, for its phase and the accounts of its destinations."""
        return self._update.motion

    @property
    def set_point_accounting(self) -> SetPointAccounting:
        """What became of the destinations that were set, as of the last update; ours."""
        return accounting_of(self._update.motion, sent=self._record.sent)

    def get_ext_torque_vector(self) -> Vector:
        """Axis torques the environment exerts, in Nm: positive where it pushes an axis towards plus."""
        return self._update.snapshot.external_torque

    def get_axis_tau_ext_msr(self) -> Vector:
        """The same under its other name."""
        return self.get_ext_torque_vector()

    def get_variance(self) -> Vector:
        """Variance of force and moment at the flange, in N2 and Nm2, due to the noise of the torque sensors."""
        return self._update.snapshot.flange_force_variance

    def get_ext_force_vector(self) -> Vector:
        """Force and moment the environment exerts at the flange: Fx, Fy, Fz in N, Mx, My, Mz in Nm, base axes.

        Estimated from the axis torques, so only as far as they show it.
        """
        return self._update.snapshot.flange_force

    def get_ext_force_msr(self) -> Vector:
        """The same under its other name."""
        return self.get_ext_force_vector()

    def get_ext_torque_variance(self) -> Vector:
        """Variance of the axis torques the environment exerts, in Nm2; ours."""
        return self._update.snapshot.external_torque_variance

    def get_control_mode(self) -> ControlMode:
        """How the arm is controlled now; ours."""
        return self._update.snapshot.control_mode

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

    def _setting_destination(
        self, destination: Iterable[float] | Pose, velocity_or_reference: VelocityOrReference
    ) -> Operation[int]:
        if isinstance(destination, Pose):
            make = self._to_pose(destination, velocity_or_reference)
        else:
            make = self._to_position(destination, velocity_or_reference)
        steps = self._timing_set_destination.new_time_step(), self._timing_update.new_time_step()
        done = yield from self._changing(make)
        for step in reversed(steps):
            step.end()
        return done.at_ns

    def _to_position(self, position: Iterable[float], velocity: VelocityOrReference) -> Callable[[int], SetDestination]:
        if isinstance(velocity, FrameName):
            raise IllegalArgumentException(
                f"a destination in axis positions has no reference frame ({velocity!r}); only a Pose has one"
            )
        position_rad, velocity_rad_s, motion = vector("destination", position), None, self._record.number
        if not (velocity is None or velocity is UNSAID):
            if self._record.kind is MotionKind.DIRECT_SERVO:
                raise IllegalArgumentException("a DirectServo takes no target velocity, only a SmartServo does")
            velocity_rad_s = vector("target velocity", velocity)
        return lambda number: SetDestination(number, motion, position_rad, velocity_rad_s)

    def _to_pose(self, destination: Pose, reference: VelocityOrReference) -> Callable[[int], SetDestination]:
        pose, motion = frames.pose("destination", destination), self._record.number
        if not (reference is None or reference is UNSAID or isinstance(reference, FrameName)):
            raise IllegalArgumentException(
                f"a Pose is followed by the frame it is in, or nothing, not by {reference!r}; "
                "a target velocity needs a destination in axis positions"
            )
        if reference is not UNSAID:
            pose = frames.in_base(self._tree, reference) @ pose
        flange_in_base = pose @ self._record.flange_in_moved
        return lambda number: SetDestination(number, motion, None, None, flange_in_base)

    def _reading_cartesian_destination(self, frame_on_flange: Moved, reference: FrameName) -> Operation[Pose | None]:
        # First, so that what is wrong with the frames is said before the controller is asked.
        moved, base = frames.in_flange(self._tree, frame_on_flange), frames.in_base(self._tree, reference)
        flange_in_base = yield from self._locating_destination()
        return None if flange_in_base is None else base.inverse() @ flange_in_base @ moved

    def _locating_destination(self) -> Operation[Pose | None]:
        """Return where the flange is at the last destination; ask where it was given in axis positions."""
        motion, taken, located = self._update.motion, self._record.taken, self._located
        if not motion.destination:
            return None
        if taken is not None and taken.flange_in_base is not None and taken.at_ns == motion.destination_at_ns:
            return taken.flange_in_base
        if located is None or located[0] != motion.destination:
            flange_in_base = yield from operations.locate_flange(self._record.session, motion.destination)
            self._located = located = motion.destination, flange_in_base
        return located[1]

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

    def _changing_control_mode(self, mode: ControlModeSettings) -> Operation[RequestDone]:
        checked, motion = control_mode(mode), self._record.number
        return self._changing(lambda number: ChangeControlMode(number, motion, checked))

    def _changing(self, make: Callable[[int], Request]) -> Operation[RequestDone]:
        done = yield from operations.change(self._record, make)
        # The answer came in a state packet of the cycle that took the request: that is an update.
        if self._record.shown is not None:
            self._update = self._record.shown
        return done
