"""Builds the monitoring message of a cycle from what the controller knows. One release, one configuration."""

from typing import Final

from hil.core.control.stage import ControlStage
from hil.core.model import ArmModel
from hil.core.motion.set_point import SetPoint
from hil.core.settings import ControllerSettings, FriSettings
from hil.core.signals import SignalTable
from hil.values.arm import ArmState
from hil.values.fri import (
    MONITORING_IDENTIFIER,
    TRAITS,
    ClientCommandMode,
    ControlMode,
    DriveState,
    OverlayKind,
    OverlayType,
    Quality,
    RedundancyStrategy,
    Release,
    SessionState,
)
from hil.values.fri_messages import (
    ConnectionInfo,
    IpoData,
    MonitorData,
    MonitoringMessage,
    Redundancy,
    RobotInfo,
    TimeStamp,
    Transformation,
    Vector,
)
from hil.values.operator import OperatorView
from hil.values.robot import JOINT_COUNT, Seven
from hil.values.tuples import new_tuple

# A member of an enumeration costs a search each time it is named by its class, and these are named in every cycle.
_COMMANDING_WAIT: Final = SessionState.COMMANDING_WAIT
_COMMANDING_ACTIVE: Final = SessionState.COMMANDING_ACTIVE
_CARTESIAN: Final = OverlayType.CARTESIAN
_E1: Final = RedundancyStrategy.E1
FLANGE_POSE_NAME = "Flange"
_COMMAND_MODES: Final = {
    OverlayKind.NONE: (ClientCommandMode.NONE, OverlayType.NONE),
    OverlayKind.JOINT_POSITION: (ClientCommandMode.JOINT_POSITION, OverlayType.JOINT),
    OverlayKind.TORQUE: (ClientCommandMode.TORQUE, OverlayType.JOINT),
    OverlayKind.WRENCH: (ClientCommandMode.WRENCH, OverlayType.JOINT),
    OverlayKind.CARTESIAN_POSE: (ClientCommandMode.CARTESIAN_POSE, OverlayType.CARTESIAN),
}
"""What the recorded clients were told with each overlay: a torque or a wrench comes beside joint positions."""


class MessageBuilder:
    """Fills in what the release has, and nothing else."""

    def __init__(
        self,
        *,
        release: Release,
        settings: ControllerSettings,
        fri: FriSettings,
        model: ArmModel,
        control: ControlStage,
        signals: SignalTable,
        requested_transformations: tuple[Transformation, ...],
    ) -> None:
        traits = TRAITS[release]
        self._tells_pose, self._tells_commanded_position = traits.pose, traits.commanded_position
        self._tells_force, self._tells_signals = traits.external_force, traits.inputs_outputs
        self._signals = signals
        self._requested_transformations = requested_transformations
        self._model = model
        self._unix_epoch_ns = settings.unix_epoch_ns
        self._fri = fri
        self._command_mode = _COMMAND_MODES[fri.overlay]
        self._ipo_data: IpoData | None = None
        self._hold: tuple[Seven, Transformation] | None = None
        """Hold position of the last Cartesian overlay, and its pose."""
        self._control = control
        self._control_mode = ControlMode.POSITION
        self._robot_info: RobotInfo | None = None
        self._operator: OperatorView | None = None
        self._connection_info: ConnectionInfo | None = None

    def build(
        self,
        *,
        sequence_counter: int,
        reflected_sequence_counter: int,
        state: SessionState,
        quality: Quality,
        arm: ArmState,
        operator: OperatorView,
        control_mode: ControlMode,
        set_point: SetPoint,
        hold_position_rad: Seven,
        tracking_performance: float,
        now_ns: int,
    ) -> MonitoringMessage:
        """Return the message; interpolator data only from COMMANDING_WAIT on."""
        commanding = state >= _COMMANDING_WAIT
        connection = self._connection_info
        if connection is None or connection.session_state is not state or connection.quality is not quality:
            connection = ConnectionInfo(state, quality, self._fri.send_period_ms, self._fri.receive_multiplier)
            self._connection_info = connection
        return new_tuple(
            MonitoringMessage,
            (
                sequence_counter,
                reflected_sequence_counter,
                self._robot(arm, operator, control_mode),
                self._monitor(arm, set_point, now_ns),
                connection,
                self._ipo(hold_position_rad, state, tracking_performance) if commanding else None,
                self._requested_transformations,
                None,
                MONITORING_IDENTIFIER,
            ),
        )

    def _robot(self, arm: ArmState, operator: OperatorView, control_mode: ControlMode) -> RobotInfo:
        info = self._robot_info
        if (
            info is None
            or operator is not self._operator
            or info.drive_states != arm.drive_states
            or control_mode is not self._control_mode
        ):
            holds = DriveState.OFF not in arm.drive_states
            info = RobotInfo(
                JOINT_COUNT,
                operator.safety_state,
                arm.drive_states,
                operator.mode,
                control_mode if holds else ControlMode.NO_CONTROL,
            )
            self._robot_info, self._operator, self._control_mode = info, operator, control_mode
        return info

    def _monitor(self, arm: ArmState, set_point: SetPoint, now_ns: int) -> MonitorData:
        pose = redundancy = None
        if self._tells_pose:
            pose = Transformation(FLANGE_POSE_NAME, self._model.flange_in_base_mm(arm.position_rad))
            redundancy = Redundancy(_E1, arm.position_rad[2])
        seconds, nanoseconds = divmod(self._unix_epoch_ns + now_ns, 1_000_000_000)
        return new_tuple(
            MonitorData,
            (
                arm.position_rad,
                arm.torque_nm,
                set_point.position_rad if self._tells_commanded_position else None,
                arm.commanded_torque_nm,
                arm.external_torque_nm,
                self._external_force(arm, now_ns) if self._tells_force else None,
                self._signals.on_wire() if self._tells_signals else (),
                pose,
                redundancy,
                new_tuple(TimeStamp, (seconds, nanoseconds)),
            ),
        )

    def _external_force(self, arm: ArmState, now_ns: int) -> Vector:
        """Return what pushes the flange in the order of the wire: moments about A, B, C, which are z, y, x."""
        fx, fy, fz, mx, my, mz = self._control.flange_wrench(arm, now_ns=now_ns)
        return (fx, fy, fz, mz, my, mx)

    def _ipo(self, hold_position_rad: Seven, state: SessionState, tracking_performance: float) -> IpoData:
        """Return the interpolator's position, or with a Cartesian overlay its pose, as the recorded clients had it."""
        tracking = tracking_performance if state is _COMMANDING_ACTIVE else 0.0
        mode, overlay_type = self._command_mode
        if overlay_type is not _CARTESIAN:
            info = self._ipo_data
            if info is None or info.position is not hold_position_rad or info.tracking_performance != tracking:
                info = self._ipo_data = IpoData(hold_position_rad, None, None, mode, overlay_type, tracking)
            return info
        if self._hold is None or hold_position_rad is not self._hold[0]:
            # It stays for as long as the overlay runs; the model would place the links twice a message.
            pose = Transformation(FLANGE_POSE_NAME, self._model.flange_in_base_mm(hold_position_rad))
            self._hold = hold_position_rad, pose
        redundancy = Redundancy(_E1, hold_position_rad[2])
        return IpoData(None, self._hold[1], redundancy, mode, overlay_type, tracking)
