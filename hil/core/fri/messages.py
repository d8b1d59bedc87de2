"""Builds the monitoring message of a cycle from what the controller knows. One release, one configuration."""

from hil.core.model import ArmModel
from hil.core.motion.set_point import SetPoint
from hil.core.settings import ControllerSettings, FriSettings
from hil.values.arm import ArmState
from hil.values.fri import (
    TRAITS,
    ClientCommandMode,
    ControlMode,
    DriveState,
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
)
from hil.values.operator import OperatorView
from hil.values.robot import JOINT_COUNT, Seven

FLANGE_POSE_NAME = "Flange"
_NO_FORCE = (0.0,) * 6
"""True of the robot sides there are: none of them models contact, so nothing can push the flange."""


class MessageBuilder:
    """Fills in what the release has, and nothing else."""

    def __init__(self, *, release: Release, settings: ControllerSettings, fri: FriSettings, model: ArmModel) -> None:
        self._traits = TRAITS[release]
        self._model = model
        self._settings = settings
        self._fri = fri
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
        set_point: SetPoint,
        hold_position_rad: Seven,
        tracking_performance: float,
        now_ns: int,
    ) -> MonitoringMessage:
        """Return the message; interpolator data only from COMMANDING_WAIT on."""
        commanding = state >= SessionState.COMMANDING_WAIT
        return MonitoringMessage(
            sequence_counter,
            reflected_sequence_counter,
            self._robot(arm, operator),
            self._monitor(arm, set_point, now_ns),
            self._connection(state, quality),
            self._ipo(hold_position_rad, state, tracking_performance) if commanding else None,
        )

    def _connection(self, state: SessionState, quality: Quality) -> ConnectionInfo:
        info = self._connection_info
        if info is None or info.session_state is not state or info.quality is not quality:
            info = ConnectionInfo(state, quality, self._fri.send_period_ms, self._fri.receive_multiplier)
            self._connection_info = info
        return info

    def _robot(self, arm: ArmState, operator: OperatorView) -> RobotInfo:
        info = self._robot_info
        if info is None or operator is not self._operator or info.drive_states != arm.drive_states:
            holds = DriveState.OFF not in arm.drive_states
            info = RobotInfo(
                JOINT_COUNT,
                operator.safety_state,
                arm.drive_states,
                operator.mode,
                ControlMode.POSITION if holds else ControlMode.NO_CONTROL,
            )
            self._robot_info, self._operator = info, operator
        return info

    def _monitor(self, arm: ArmState, set_point: SetPoint, now_ns: int) -> MonitorData:
        traits = self._traits
        pose = redundancy = None
        if traits.pose:
            pose = Transformation(FLANGE_POSE_NAME, self._model.flange_in_base_mm(arm.position_rad))
            redundancy = Redundancy(RedundancyStrategy.E1, arm.position_rad[2])
        unix_ns = self._settings.unix_epoch_ns + now_ns
        return MonitorData(
            arm.position_rad,
            arm.torque_nm,
            set_point.position_rad if traits.commanded_position else None,
            arm.commanded_torque_nm,
            arm.external_torque_nm,
            _NO_FORCE if traits.external_force else None,
            (),
            pose,
            redundancy,
            TimeStamp(unix_ns // 1_000_000_000, unix_ns % 1_000_000_000),
        )

    @staticmethod
    def _ipo(hold_position_rad: Seven, state: SessionState, tracking_performance: float) -> IpoData:
        return IpoData(
            hold_position_rad,
            None,
            None,
            ClientCommandMode.JOINT_POSITION,
            OverlayType.JOINT,
            tracking_performance if state is SessionState.COMMANDING_ACTIVE else 0.0,
        )
