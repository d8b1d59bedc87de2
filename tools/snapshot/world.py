"""The world of a picture: robots where they stand and as they stand, and what is around them."""

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import mujoco
import numpy as np

from backends.mujoco.options import parse_options
from backends.mujoco.scene import build, prefix_of
from backends.robots import load_description
from hil.values.errors import ConfigurationError, OutOfRange, UnknownName
from hil.values.robot import JOINT_COUNT, JOINT_NAMES, Seven
from hil.values.surroundings import SceneArm, Surroundings
from tools.snapshot.camera import Points

_ROUNDING_RAD: Final = 1e-9
_GROUPS_SHOWN: Final = 3
"""MuJoCo shows the groups 0, 1 and 2; what only collides is in another one."""


class PictureWorld:
    """A world whose robots stand as they are told, or in their initial positions."""

    def __init__(self, surroundings: Surroundings, positions_rad: Mapping[str, Seven]) -> None:
        """Put the robots of ``surroundings`` up; ``positions_rad`` by the name of the robot."""
        arms = surroundings.arms
        starts = {arm.name: load_description(arm.model).initial_position_rad for arm in arms}
        self.model = build(arms, surroundings.objects, scene=_scene_file(arms))
        self.data = mujoco.MjData(self.model)
        for arm in arms:
            for joint, value in zip(JOINT_NAMES, positions_rad.get(arm.name, starts[arm.name]), strict=True):
                self.data.joint(prefix_of(arm.name) + joint).qpos[0] = value
        mujoco.mj_forward(self.model, self.data)

    def flange_m(self, robot: str) -> Points:
        """Return where a robot's flange is in the world."""
        place: Points = self.data.site(f"{prefix_of(robot)}flange").xpos.copy()
        return place

    def points_m(self) -> Points:
        """Return points around everything there is to see but planes, which have no end."""
        model, corners = self.model, np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        points = []
        for geom in range(model.ngeom):
            kind = mujoco.mjtGeom(model.geom_type[geom])
            if model.geom_group[geom] >= _GROUPS_SHOWN or kind == mujoco.mjtGeom.mjGEOM_PLANE:
                continue
            if kind == mujoco.mjtGeom.mjGEOM_MESH:
                mesh = model.mesh(model.geom_dataid[geom])
                own = model.mesh_vert[int(mesh.vertadr[0]) : int(mesh.vertadr[0]) + int(mesh.vertnum[0])]
            else:
                own = model.geom_aabb[geom, :3] + corners * model.geom_aabb[geom, 3:]
            points.append(own @ self.data.geom_xmat[geom].reshape(3, 3).T + self.data.geom_xpos[geom])
        return np.concatenate(points)


def parse_position(text: str, arms: Sequence[SceneArm]) -> tuple[str, Seven]:
    """Return the robot and its position in rad, of seven degrees: ``0 30 0 40 0 90 0``, or ``NAME=0 30 ...``.

    Raises :class:`ConfigurationError` for what is no position, or is beyond the limits of an axis.
    """
    name, named, numbers = text.rpartition("=")
    by_name = {arm.name: arm for arm in arms}
    if not named:
        if len(arms) > 1:
            raise ConfigurationError(
                f"whose position is {text!r}? With several robots write NAME=..., {_names(by_name)}"
            )
        name = arms[0].name
    if name not in by_name:
        raise UnknownName("robot", name, by_name)
    parts = [part for part in re.split(r"[\s,;]+", numbers.strip()) if part]
    try:
        degrees = [float(part) for part in parts]
    except ValueError:
        raise ConfigurationError(f"the position {numbers!r} is no list of numbers: seven degrees, A1 to A7") from None
    if len(degrees) != JOINT_COUNT:
        raise ConfigurationError(f"the position {numbers!r} has {len(degrees)} numbers: seven degrees are, A1 to A7")
    limits = load_description(by_name[name].model).limits
    for joint, value, low, high in zip(
        JOINT_NAMES, degrees, limits.position_min_rad, limits.position_max_rad, strict=True
    ):
        if not low - _ROUNDING_RAD <= math.radians(value) <= high + _ROUNDING_RAD:
            raise OutOfRange(f"{joint} of {name}", value, f"{math.degrees(low):g} ... {math.degrees(high):g} degrees")
    a1, a2, a3, a4, a5, a6, a7 = map(math.radians, degrees)
    return name, (a1, a2, a3, a4, a5, a6, a7)


def _names(names: Mapping[str, object]) -> str:
    return f"NAME one of {', '.join(names)}"


def _scene_file(arms: Sequence[SceneArm]) -> Path | None:
    files = {parse_options(arm.options).scene for arm in arms if arm.backend == "mujoco"} - {None}
    if len(files) > 1:
        names = " and ".join(sorted(map(str, files)))
        raise ConfigurationError(f"the station has the scene files {names}; one picture shows one")
    return next(iter(files), None)
