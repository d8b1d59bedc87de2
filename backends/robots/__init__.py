"""The robots: what is known of each, and its model in MuJoCo and in Pinocchio, both from one MJCF file.

Position and torque limits, joint damping, friction loss and armature reach both libraries from the file.
MJCF has no velocity limit: take it from the description. Contact is not modelled.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from backends.robots.facts import ROBOTS
from hil.values.errors import UnknownName
from hil.values.robot import RobotDescription

if TYPE_CHECKING:
    import mujoco
    import pinocchio

FLANGE = "flange"
"""Name of the flange: a site in MuJoCo, an operational frame in Pinocchio."""

_DESCRIPTIONS = {facts.description.name: facts.description for facts in ROBOTS}


def robot_names() -> tuple[str, ...]:
    """Names of all robots, as used on the command line and in station files."""
    return tuple(_DESCRIPTIONS)


def load_description(name: str) -> RobotDescription:
    """Limits, payload and start pose of a robot; ``UnknownName`` if there is none of that name."""
    try:
        return _DESCRIPTIONS[name]
    except KeyError:
        raise UnknownName("robot", name, robot_names()) from None


def mjcf_path(name: str) -> Path:
    """The robot's MJCF file, which ``tools/make_robots.py`` wrote beside this module."""
    return Path(__file__).with_name(f"{load_description(name).name}.xml")


def load_mujoco(name: str, *, shells: bool = True) -> "mujoco.MjModel":
    """A fresh MuJoCo model of the robot: seven joints and seven torque motors, A1 to A7, in this order.

    Without ``shells`` it has nothing to draw, which nobody needs to simulate it.
    """
    path = mjcf_path(name)
    import mujoco

    spec = mujoco.MjSpec.from_file(str(path))
    spec.compiler.discardvisual = not shells
    return spec.compile()


def load_pinocchio(name: str) -> "pinocchio.Model":
    """A fresh Pinocchio model of the robot: seven joints, A1 to A7, in this order.

    Its armature is part of every mass matrix Pinocchio computes, as it is in MuJoCo. For the inertia of the
    bodies alone, set ``model.armature`` to zero.
    """
    path = mjcf_path(name)
    import pinocchio

    return pinocchio.buildModelFromMJCF(str(path))
