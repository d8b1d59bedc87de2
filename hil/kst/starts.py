"""From a line that starts something, and the registers, to the job it starts; or a sentence that says why to none."""

from collections.abc import Callable, Mapping
from typing import Final

from hil.kst.jobs import (
    CartesianServo,
    CircleMotion,
    ImpedanceServo,
    JointMotion,
    JointServo,
    LineMotion,
    Mode,
    Motion,
    RelativeLine,
    TorqueRange,
    VelocityServo,
)
from hil.kst.registers import Registers, pose_of
from hil.values.pose import Pose
from hil.values.servo import Vector
from transport.kst import AXES, Command, Request

_MM: Final = 1e-3


def motion_of(request: Request, registers: Registers, tcp_in_flange: Pose) -> Motion | str:
    """Return the motion a start line asks for, or why there is none."""
    return _MOTIONS[request.spec.command](request, registers, tcp_in_flange)


def mode_of(request: Request, tcp_in_flange: Pose) -> Mode:
    """Return the real-time mode a start line asks for."""
    match request.spec.command:
        case Command.START_JOINT_SERVO:
            return JointServo()
        case Command.START_CARTESIAN_SERVO:
            return CartesianServo(tcp_in_flange)
        case Command.START_VELOCITY_SERVO:
            return VelocityServo()
        case _:
            mass_kg, x, y, z, translational, rotational, null_space = request.values
            return ImpedanceServo(mass_kg, (x, y, z), translational, rotational, null_space)


def _joints(request: Request, registers: Registers, _tcp: Pose) -> Motion | str:
    conditional = request.spec.command is Command.MOVE_JOINTS_UNTIL
    conditions = _conditions(request.values)
    if isinstance(conditions, str):
        return conditions
    if registers.joints_rad is None:
        return "there is no joint target (jp_), or it was refused"
    if registers.speed is None or registers.speed > 1.0:
        return _no_speed(registers, "a joint motion has a relative speed above 0, up to 1")
    return JointMotion(registers.joints_rad, registers.speed, conditions, conditional)


def _line(request: Request, registers: Registers, tcp: Pose) -> Motion | str:
    conditional = request.spec.command is Command.MOVE_LINE_UNTIL
    conditions = _conditions(request.values)
    if isinstance(conditions, str):
        return conditions
    if request.text.startswith(f"{request.spec.token}Rel"):
        return "a published server takes a conditional relative line for an absolute one; move by doPTP!inCS instead"
    if registers.pose_values is None:
        return "there is no Cartesian target (cArtixanPosition_), or it was refused"
    if registers.speed is None:
        return _no_speed(registers, "a line has a speed in mm/s")
    return LineMotion(pose_of(registers.pose_values), registers.speed, tcp, conditions, conditional)


def _relative_line(request: Request, registers: Registers, tcp: Pose) -> Motion | str:
    if registers.pose_values is None:
        return "there is no displacement (cArtixanPosition_), or it was refused"
    if registers.speed is None:
        return _no_speed(registers, "a line has a speed in mm/s")
    way_m = tuple(value * _MM for value in registers.pose_values[:3])
    return RelativeLine(way_m, request.spec.command is Command.MOVE_LINE_IN_TOOL, registers.speed, tcp)


def _circle(_request: Request, registers: Registers, tcp: Pose) -> Motion | str:
    if registers.auxiliary_values is None or registers.end_values is None:
        return "a circle needs both its points (cArtixanPositionCirc1_ and cArtixanPositionCirc2_)"
    if registers.speed is None:
        return _no_speed(registers, "a circle has a speed in mm/s")
    return CircleMotion(pose_of(registers.auxiliary_values), pose_of(registers.end_values), registers.speed, tcp)


def _circle_until(_request: Request, _registers: Registers, _tcp: Pose) -> Motion | str:
    return "a published server does a joint motion instead of a conditional circle; neither is done here"


_MOTIONS: Final[Mapping[Command, Callable[[Request, Registers, Pose], Motion | str]]] = {
    Command.MOVE_JOINTS: _joints,
    Command.MOVE_JOINTS_UNTIL: _joints,
    Command.MOVE_LINE: _line,
    Command.MOVE_LINE_UNTIL: _line,
    Command.MOVE_LINE_IN_BASE: _relative_line,
    Command.MOVE_LINE_IN_TOOL: _relative_line,
    Command.MOVE_CIRCLE: _circle,
    Command.MOVE_CIRCLE_UNTIL: _circle_until,
}


def _no_speed(registers: Registers, what: str) -> str:
    speed = registers.speed
    return f"{what}; it is {'not set (jRelVel_)' if speed is None else f'{speed:g}'}"


def _conditions(values: Vector) -> tuple[TorqueRange, ...] | str:
    """Return the conditions of a motion, or why they are none."""
    ranges: list[TorqueRange] = []
    for place in range(0, len(values), 3):
        axis, least, most = values[place : place + 3]
        if not (axis.is_integer() and 0 <= axis < AXES):
            return f"there is no axis {axis:g}; the first one is 0, the last {AXES - 1}"
        if least > most:
            return f"the torque range {least:g}..{most:g} Nm is empty"
        ranges.append(TorqueRange(int(axis), least, most))
    return tuple(ranges)
