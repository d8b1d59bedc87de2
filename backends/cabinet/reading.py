"""What a monitoring message must hold to be believed, and what it says of the arm and of the Cabinet."""

import math
from typing import Final, NamedTuple

from hil.values.arm import seven
from hil.values.errors import MalformedDatagram
from hil.values.fri import (
    TRAITS,
    ClientCommandMode,
    ControlMode,
    DriveState,
    OperationMode,
    Quality,
    Release,
    SafetyState,
    SessionState,
)
from hil.values.fri_messages import MonitoringMessage, Vector
from hil.values.outcomes import Outcome
from hil.values.robot import JOINT_COUNT, Seven

_NONE: Seven = (0.0,) * JOINT_COUNT  # type: ignore[assignment]
_DRIVES: Final[dict[tuple[int, ...], tuple[DriveState, ...]]] = {}
"""Drive states by their numbers: mostly the same seven again, as the same object."""
_MOST_DRIVES: Final = 256


class Said(NamedTuple):
    """One monitoring message, as far as this controller needs it; rad, Nm."""

    counter: int
    state: SessionState
    quality: Quality
    send_period_ms: int
    receive_multiplier: int
    operation_mode: OperationMode
    safety_state: SafetyState
    control_mode: ControlMode
    drive_states: tuple[DriveState, ...]
    position_rad: Seven
    torque_nm: Seven
    external_torque_nm: Seven
    commanded_torque_nm: Seven
    commanded_position_rad: Vector | None
    """1.x only: what a client in monitoring answers with."""
    interpolator_rad: Seven | None
    """From COMMANDING_WAIT on, for an overlay of joints."""
    command_mode: ClientCommandMode


def read_message(message: MonitoringMessage, release: Release) -> Said:
    """Return what a message says; raise :class:`MalformedDatagram` for one that says too little, or what cannot be."""
    robot, monitor, connection, ipo = message.robot, message.monitor, message.connection, message.ipo
    if robot is None or monitor is None or connection is None or connection.send_period_ms is None:
        raise _shape("a message without robot, monitor or connection data")
    echoed = monitor.commanded_position is not None
    if echoed != TRAITS[release].commanded_position and connection.session_state != SessionState.IDLE:
        looks_like = Release.V1_15 if echoed else Release.V2_5
        which = "1.x sends commanded positions" if echoed else "2.x sends no commanded positions"
        raise MalformedDatagram(Outcome.OTHER_RELEASE, f"{which}; configured: {release}", looks_like=looks_like)
    try:
        return Said(
            message.sequence_counter,
            SessionState(connection.session_state),
            Quality(connection.quality),
            connection.send_period_ms,
            max(1, connection.receive_multiplier or 1),
            OperationMode(robot.operation_mode or 0),
            SafetyState(robot.safety_state or 0),
            ControlMode(robot.control_mode or 0),
            _drives(robot.drive_states),
            _joints(monitor.measured_position, "measured position"),
            _joints(monitor.measured_torque, "measured torque"),
            _NONE if monitor.external_torque is None else _joints(monitor.external_torque, "external torque"),
            _NONE if monitor.commanded_torque is None else _joints(monitor.commanded_torque, "commanded torque"),
            None if monitor.commanded_position is None else _joints(monitor.commanded_position, "commanded position"),
            None if ipo is None or ipo.position is None else _joints(ipo.position, "interpolator position"),
            ClientCommandMode(0 if ipo is None else ipo.client_command_mode or 0),
        )
    except ValueError as error:
        raise _shape(str(error)) from None


def _joints(values: Vector | None, what: str) -> Seven:
    if values is None or len(values) != JOINT_COUNT:
        raise _shape(f"{what}: {0 if values is None else len(values)} values, {JOINT_COUNT} are needed")
    if not math.isfinite(sum(values)):
        raise MalformedDatagram(Outcome.NOT_FINITE, f"{what} is not finite")
    return seven(values)


def _drives(numbers: tuple[int, ...]) -> tuple[DriveState, ...]:
    known = _DRIVES.get(numbers)
    if known is None:
        if len(numbers) != JOINT_COUNT:
            raise _shape(f"{len(numbers)} drive states, {JOINT_COUNT} are needed")
        known = tuple(map(DriveState, numbers))
        if len(_DRIVES) >= _MOST_DRIVES:
            _DRIVES.clear()
        _DRIVES[numbers] = known
    return known


def _shape(detail: str) -> MalformedDatagram:
    return MalformedDatagram(Outcome.SHAPE, detail)
