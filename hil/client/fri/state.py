"""What a monitoring message tells the application, read-only."""

from dataclasses import dataclass
from enum import IntEnum
from typing import TypeVar

from hil.client.fri.errors import NotAvailable, WrongSignal
from hil.values.errors import UnknownName
from hil.values.fri import (
    TRAITS,
    ClientCommandMode,
    ControlMode,
    DriveState,
    IOType,
    OperationMode,
    OverlayType,
    Quality,
    Release,
    SafetyState,
    SessionState,
)
from hil.values.fri_messages import (
    IOValue,
    IpoData,
    MonitorData,
    MonitoringMessage,
    Redundancy,
    RobotInfo,
    TimeStamp,
    Transformation,
    Vector,
)

_E = TypeVar("_E", bound=IntEnum)
_T = TypeVar("_T")

_NOT_SENT = "the controller did not send it"
_NO_IPO = "interpolator data come from COMMANDING_WAIT on"
_ONLY_TWO = "only 2.x has it"


@dataclass(frozen=True, slots=True)
class FriState:
    """One monitoring message of one release. Joint vectors are A1..A7.

    What a release does not have, or does not send in the present session state, raises :class:`NotAvailable`.
    """

    release: Release
    """Configured release."""
    message: MonitoringMessage
    """The message itself, as it was on the wire."""
    session_state: SessionState
    """Session state."""
    quality: Quality
    """Connection quality, as the controller measures it."""

    @property
    def sequence_counter(self) -> int:
        """Counter of the message, modulo 2^32."""
        return self.message.sequence_counter

    @property
    def send_period_ms(self) -> int:
        """Milliseconds between two monitoring messages."""
        connection = self.message.connection
        return self._there(None if connection is None else connection.send_period_ms, "send period")

    @property
    def receive_multiplier(self) -> int:
        """Every so many-th monitoring message is answered; at least 1."""
        connection = self.message.connection
        return 1 if connection is None else max(1, connection.receive_multiplier or 1)

    @property
    def sample_time_s(self) -> float:
        """Seconds between two callbacks: the send period. What a callback integrates with (vendor: getSampleTime)."""
        return self.send_period_ms * 0.001

    @property
    def answer_period_s(self) -> float:
        """Seconds between two answers: send period x receive multiplier."""
        return self.send_period_ms * self.receive_multiplier * 0.001

    @property
    def time_stamp(self) -> TimeStamp:
        """Unix time of the measurement."""
        return self._there(self._monitor("time stamp").at, "time stamp")

    @property
    def safety_state(self) -> SafetyState:
        """What kind of stop is active."""
        return self._named(SafetyState, self._robot("safety state").safety_state, "safety state")

    @property
    def operation_mode(self) -> OperationMode:
        """Operation mode of the controller."""
        return self._named(OperationMode, self._robot("operation mode").operation_mode, "operation mode")

    @property
    def control_mode(self) -> ControlMode:
        """Control mode of the arm."""
        return self._named(ControlMode, self._robot("control mode").control_mode, "control mode")

    @property
    def drive_states(self) -> tuple[DriveState, ...]:
        """State of each drive, A1..A7."""
        drives = self._robot("drive state").drive_states
        return tuple(self._named(DriveState, drive, "drive state") for drive in drives)

    @property
    def client_command_mode(self) -> ClientCommandMode:
        """What the client may command; NONE before COMMANDING_WAIT."""
        ipo = self.message.ipo
        mode = None if ipo is None else ipo.client_command_mode
        return self._named(ClientCommandMode, mode or 0, "client command mode")

    @property
    def overlay_type(self) -> OverlayType:
        """Kind of the running overlay; NONE before COMMANDING_WAIT."""
        ipo = self.message.ipo
        return self._named(OverlayType, 0 if ipo is None else ipo.overlay_type or 0, "overlay type")

    @property
    def tracking_performance(self) -> float:
        """How far the arm follows the command, 0..1; 0 outside COMMANDING_ACTIVE."""
        ipo = self.message.ipo
        return 0.0 if ipo is None else ipo.tracking_performance or 0.0

    @property
    def measured_position_rad(self) -> Vector:
        """Measured axis positions in rad."""
        return self._there(self._monitor("measured position").measured_position, "measured position")

    @property
    def commanded_position_rad(self) -> Vector:
        """Axis positions in rad the arm was commanded last (1.x only)."""
        what = "commanded position"
        if not TRAITS[self.release].commanded_position:
            raise self._missing(what, "only 1.x sends it; use the measured or the interpolator position")
        return self._there(self._monitor(what).commanded_position, what)

    @property
    def interpolator_position_rad(self) -> Vector:
        """Axis positions in rad the interpolator gives out, to mirror or to lay a motion over."""
        what = "interpolator position"
        return self._there(self._ipo(what).position, what, "the running overlay is not one of joint positions")

    @property
    def measured_torque_nm(self) -> Vector:
        """Torques in Nm the joint sensors measure."""
        return self._there(self._monitor("measured torque").measured_torque, "measured torque")

    @property
    def commanded_torque_nm(self) -> Vector:
        """Torques in Nm the arm was commanded last."""
        return self._there(self._monitor("commanded torque").commanded_torque, "commanded torque")

    @property
    def external_torque_nm(self) -> Vector:
        """Torques in Nm that come from outside: measured, without the arm's own weight and motion."""
        return self._there(self._monitor("external torque").external_torque, "external torque")

    @property
    def external_force(self) -> Vector:
        """Estimated force at the tool (2.7): Fx Fy Fz in N, then the moments about A, B, C in Nm."""
        what = "external force"
        if not TRAITS[self.release].external_force:
            raise self._missing(what, "only 2.7 sends it")
        return self._there(self._monitor(what).external_force, what)

    @property
    def measured_pose(self) -> Vector:
        """Measured pose (2.x): tx ty tz in mm, then the quaternion w x y z."""
        return self._there(self._monitor("measured pose", only_two=True).measured_pose, "measured pose").values

    @property
    def measured_redundancy(self) -> Redundancy:
        """Redundancy of the measured pose (2.x)."""
        return self._there(self._monitor("redundancy", only_two=True).redundancy, "redundancy")

    @property
    def interpolator_pose(self) -> Vector:
        """Pose the interpolator gives out (2.x, Cartesian overlay): tx ty tz in mm, then the quaternion w x y z."""
        what = "interpolator pose"
        self._only_two(what)
        return self._there(self._ipo(what).pose, what, "the running overlay is not one of poses").values

    @property
    def interpolator_redundancy(self) -> Redundancy:
        """Redundancy of the interpolator's pose (2.x, Cartesian overlay)."""
        what = "interpolator redundancy"
        self._only_two(what)
        return self._there(self._ipo(what).redundancy, what, "the running overlay is not one of poses")

    @property
    def inputs_outputs(self) -> tuple[IOValue, ...]:
        """Inputs and outputs the controller lists (from 1.14 on)."""
        if not TRAITS[self.release].inputs_outputs:
            raise self._missing("input or output", "they exist from 1.14 on")
        monitor = self.message.monitor
        return () if monitor is None else monitor.inputs_outputs

    def io_value(self, name: str) -> bool | int | float:
        """Return the value of the input or output ``Group.Name``; raise :class:`UnknownName`."""
        for io in self.inputs_outputs:
            if io.name == name:
                if io.type == IOType.ANALOG:
                    return io.analog or 0.0
                return bool(io.digital) if io.type == IOType.BOOLEAN else io.digital or 0
        raise UnknownName("input or output", name, (io.name for io in self.inputs_outputs))

    def boolean_io(self, name: str) -> bool:
        """Return the value of a boolean input or output; raise :class:`UnknownName` or :class:`WrongSignal`."""
        return bool(self._io(name, IOType.BOOLEAN).digital)

    def digital_io(self, name: str) -> int:
        """Return the value of a digital input or output; raise :class:`UnknownName` or :class:`WrongSignal`."""
        return self._io(name, IOType.DIGITAL).digital or 0

    def analog_io(self, name: str) -> float:
        """Return the value of an analog input or output; raise :class:`UnknownName` or :class:`WrongSignal`."""
        return self._io(name, IOType.ANALOG).analog or 0.0

    @property
    def requested_transformations(self) -> tuple[Transformation, ...]:
        """Transformations the controller asks the client for, with the values it uses now."""
        return self.message.requested_transformations

    def _io(self, name: str, type_: IOType) -> IOValue:
        for io in self.inputs_outputs:
            if io.name == name:
                if io.type != type_:
                    raise WrongSignal(name, f"it is {io_type_name(io.type)}, not {io_type_name(type_)}")
                return io
        raise UnknownName("input or output", name, (io.name for io in self.inputs_outputs))

    def _missing(self, what: str, reason: str) -> NotAvailable:
        return NotAvailable(what, release=self.release, state=self.session_state, reason=reason)

    def _there(self, value: _T | None, what: str, reason: str = _NOT_SENT) -> _T:
        if value is None:
            raise self._missing(what, reason)
        return value

    def _named(self, enumeration: type[_E], number: int | None, what: str) -> _E:
        try:
            return enumeration(self._there(number, what))
        except ValueError as error:
            if isinstance(error, NotAvailable):
                raise
            raise self._missing(f"{what} {number}", "the controller sent a number that names nothing") from None

    def _robot(self, what: str) -> RobotInfo:
        return self._there(self.message.robot, what)

    def _monitor(self, what: str, *, only_two: bool = False) -> MonitorData:
        if only_two:
            self._only_two(what)
        return self._there(self.message.monitor, what)

    def _ipo(self, what: str) -> IpoData:
        return self._there(self.message.ipo, what, _NO_IPO)

    def _only_two(self, what: str) -> None:
        if not TRAITS[self.release].pose:
            raise self._missing(what, _ONLY_TWO)


def io_type_name(number: int) -> str:
    """Return what a type of an input or output is called."""
    try:
        return IOType(number).name.lower()
    except ValueError:
        return f"of type {number}"
