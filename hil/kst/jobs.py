"""What a session wants the arm to do: one job at a time. Joints in rad, poses in the robot base, metres."""

from enum import StrEnum
from typing import NamedTuple, TypeAlias

from hil.values.pose import NOWHERE, Pose
from hil.values.servo import Vector


class Outcome(StrEnum):
    """How a job ended."""

    DONE = "done"
    INTERRUPTED = "interrupted"
    """A condition was met before the target was reached."""
    FAILED = "failed"


class TorqueRange(NamedTuple):
    """A motion is interrupted while the measured torque of ``axis`` (0 to 6) is outside ``least_nm``..``most_nm``."""

    axis: int
    least_nm: float
    most_nm: float


class JointMotion(NamedTuple):
    """PTP to axis positions, at a share of what the axes can do."""

    target_rad: Vector
    velocity_rel: float
    conditions: tuple[TorqueRange, ...] = ()
    conditional: bool = False


class LineMotion(NamedTuple):
    """The TCP on a straight line to a pose."""

    target: Pose
    speed_mm_s: float
    tcp_in_flange: Pose = NOWHERE
    conditions: tuple[TorqueRange, ...] = ()
    conditional: bool = False


class RelativeLine(NamedTuple):
    """The TCP on a straight line by a way, along the axes of the base or its own; its orientation stays."""

    way_m: Vector
    in_tool: bool
    speed_mm_s: float
    tcp_in_flange: Pose = NOWHERE


class CircleMotion(NamedTuple):
    """The TCP on the circle through where it is, ``auxiliary`` and ``end``."""

    auxiliary: Pose
    end: Pose
    speed_mm_s: float
    tcp_in_flange: Pose = NOWHERE


class JointServo(NamedTuple):
    """DirectServo to the newest joint set-point."""


class CartesianServo(NamedTuple):
    """DirectServo of the TCP to the newest Cartesian set-point."""

    tcp_in_flange: Pose = NOWHERE


class VelocityServo(NamedTuple):
    """DirectServo along the newest joint velocities."""


class ImpedanceServo(NamedTuple):
    """SmartServo to the newest joint set-point, on Cartesian springs, with a tool of its own."""

    mass_kg: float
    centre_mm: Vector
    translational_n_m: float
    rotational_nm_rad: float
    null_space_nm_rad: float


Motion: TypeAlias = JointMotion | LineMotion | RelativeLine | CircleMotion
Mode: TypeAlias = JointServo | CartesianServo | VelocityServo | ImpedanceServo
Job: TypeAlias = Motion | Mode


class Ended(NamedTuple):
    """How a job ended, and why."""

    outcome: Outcome
    reason: str = ""
