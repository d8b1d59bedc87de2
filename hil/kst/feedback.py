"""The numbers of a reply, from the controller's latest state."""

from collections.abc import Callable, Mapping
from typing import Final

from hil.kst.registers import values_of
from hil.values.pose import Pose
from hil.values.servo import Snapshot, Vector
from transport.kst import Feedback


def numbers(feedback: Feedback, snapshot: Snapshot, tcp_in_flange: Pose) -> Vector:
    """Return the numbers of a reply: rad, mm and rad, N, Nm; forces at the TCP, along its axes."""
    return _NUMBERS[feedback](snapshot, tcp_in_flange)


def _pose(snapshot: Snapshot, tcp_in_flange: Pose) -> Vector:
    return values_of(snapshot.flange_in_base @ tcp_in_flange)


def _force(snapshot: Snapshot, tcp_in_flange: Pose) -> Vector:
    return _in_tool(snapshot, tcp_in_flange, snapshot.flange_force[:3])


def _moment(snapshot: Snapshot, tcp_in_flange: Pose) -> Vector:
    fx, fy, fz, mx, my, mz = snapshot.flange_force
    tcp = snapshot.flange_in_base @ tcp_in_flange
    x, y, z = (there - here for there, here in zip(tcp[:3], snapshot.flange_in_base[:3], strict=True))
    # The same load, seen from another point: the moment loses the arm of the force.
    return _in_tool(snapshot, tcp_in_flange, (mx - (y * fz - z * fy), my - (z * fx - x * fz), mz - (x * fy - y * fx)))


def _in_tool(snapshot: Snapshot, tcp_in_flange: Pose, in_base: Vector) -> Vector:
    to_tool = (snapshot.flange_in_base @ tcp_in_flange).inverse().rotation
    turned = Pose(0.0, 0.0, 0.0, to_tool) @ Pose(*in_base)  # type: ignore[arg-type]  # three numbers
    return turned.position_m


_NUMBERS: Final[Mapping[Feedback, Callable[[Snapshot, Pose], Vector]]] = {
    Feedback.JOINTS: lambda snapshot, _tcp: snapshot.measured_position,
    Feedback.POSE: _pose,
    Feedback.FORCE: _force,
    Feedback.MOMENT: _moment,
    Feedback.EXTERNAL_TORQUES: lambda snapshot, _tcp: snapshot.external_torque,
    Feedback.MEASURED_TORQUES: lambda snapshot, _tcp: snapshot.measured_torque,
}
