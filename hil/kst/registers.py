"""The set-points a program has set: one register set, shared by motions and real-time modes."""

from dataclasses import dataclass, field
from typing import Final

from hil.values.pose import Pose
from hil.values.servo import Vector

STILL: Final[Vector] = (0.0,) * 7
_MM: Final = 1e-3
_MM_PER_M: Final = 1e3


@dataclass(slots=True)
class Registers:
    """What was set last; None: nothing yet, or what was set was refused, and no motion may go there."""

    joints_rad: Vector | None = None
    pose_values: Vector | None = None
    """Cartesian target, or a way: x, y, z in mm, A, B, C in rad."""
    auxiliary_values: Vector | None = None
    end_values: Vector | None = None
    servo_pose: Vector | None = None
    """Cartesian set-point, as the targets."""
    velocity_rad_s: Vector = STILL
    velocity_at_ns: int = 0
    """When that was set."""
    speed: float | None = None
    """For all motions that follow: share of the axis velocity for joint motions, mm/s for the others."""
    set_points: int = field(default=0)
    """Real-time set-points taken."""


def pose_of(values: Vector) -> Pose:
    """Return the pose of x, y, z in mm and A, B, C in rad."""
    x, y, z, a, b, c = values
    return Pose.from_abc_rad((x * _MM, y * _MM, z * _MM), a, b, c)


def values_of(pose: Pose) -> Vector:
    """Return x, y, z in mm and A, B, C in rad."""
    x, y, z = pose.position_m
    return (x * _MM_PER_M, y * _MM_PER_M, z * _MM_PER_M, *pose.abc_rad())
