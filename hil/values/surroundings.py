"""What stands around simulated arms, and which arms stand there together; SI units, poses in the world."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from hil.values.load import NO_LOAD, Load
from hil.values.pose import NOWHERE, Pose
from hil.values.robot import Three

GREY: Final = (0.55, 0.58, 0.62)


class Shape(StrEnum):
    """Shape of an object."""

    BOX = "box"
    CYLINDER = "cylinder"
    SPHERE = "sphere"
    PLANE = "plane"


SIZES: Final = {Shape.BOX: 3, Shape.CYLINDER: 2, Shape.SPHERE: 1, Shape.PLANE: 0}
"""How many sizes a shape has: lengths along x, y, z; diameter and height; diameter; a plane has none."""


@dataclass(frozen=True, slots=True)
class SceneObject:
    """One object; its pose is that of its middle, a plane's that of any point of it, with z upwards."""

    name: str
    shape: Shape
    size_m: tuple[float, ...] = ()
    pose: Pose = NOWHERE
    mass_kg: float | None = None
    """None: it stands fast."""
    friction: float = 1.0
    colour: Three = GREY
    """Red, green, blue, 0..1."""


@dataclass(frozen=True, slots=True)
class SceneArm:
    """One robot of a station, as the others see it."""

    name: str
    model: str
    backend: str
    options: Mapping[str, object]
    base_in_world: Pose = NOWHERE
    load: Load = NO_LOAD
    cycle_ns: int = 1_000_000
    touches_m: tuple[Three, ...] = ()
    """Points of its mounted tool, in the flange."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Of a whole station, the same object for all its robots."""

    objects: tuple[SceneObject, ...] = ()
    arms: tuple[SceneArm, ...] = ()
    shared: dict[str, object] = field(default_factory=dict)
    """What backends of one station share, by a name of their own; empty at the start."""
