"""What a callback returns: the part of the answer that is the application's."""

from collections.abc import Mapping
from dataclasses import dataclass

from hil.client.fri.errors import CommandShape
from hil.values.fri_messages import Transformation, Vector

_LENGTHS = (("joint_position_rad", 7), ("torque_nm", 7), ("wrench", 6), ("pose", 7))


@dataclass(frozen=True, slots=True)
class Command:
    """One answer. What is None is filled in as the session needs it, so give only what you want to differ.

    The joint position is mirrored from the interpolator (in 1.x monitoring states: the commanded position), the pose
    of a Cartesian pose overlay likewise; torque and wrench are zero where the client command mode asks for them.
    """

    joint_position_rad: Vector | None = None
    """Seven axis positions A1..A7 in rad."""
    torque_nm: Vector | None = None
    """Seven torques in Nm, laid over those of joint impedance control."""
    wrench: Vector | None = None
    """Fx Fy Fz in N, then the moments about A, B, C in Nm."""
    pose: Vector | None = None
    """Cartesian pose of 2.x: tx ty tz in mm, then the quaternion w x y z."""
    e1_rad: float | None = None
    """Redundancy of the pose (2.x): position of A3 in rad."""
    outputs: Mapping[str, bool | int | float] | None = None
    """Values of outputs by name ``Group.Name``, from 1.14 on; the controller must have listed them as outputs."""
    transformations: tuple[Transformation, ...] = ()
    """Values of the transformations the controller asked for; 12 numbers each in 1.x, 7 in 2.x, translation in mm.

    :func:`hil.client.fri.make_transformation` makes them for either.
    """
    mirror: bool = True
    """Whether what is None is filled in; without, the answer holds nothing else, as that of the vendor's I/O client."""

    def __post_init__(self) -> None:
        for name, want in _LENGTHS:
            values: Vector | None = getattr(self, name)
            if values is not None and len(values) != want:
                raise CommandShape(name, got=len(values), want=want)
