"""Where the links of an arm are, for whoever draws it."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco

from backends.robots import FLANGE, load_mujoco
from hil.values.robot import JOINT_COUNT, Three

LINKS = JOINT_COUNT + 1
"""The base, and seven that move."""


class LinkPose(NamedTuple):
    """A link in the robot base: m, and a unit quaternion w, x, y, z."""

    position_m: Three
    wxyz: tuple[float, float, float, float]


class LinkPoses:
    """Of one robot model; keeps buffers of its own, so one thread may ask."""

    def __init__(self, model: str) -> None:
        self._model = load_mujoco(model, shells=False)
        self._data = mujoco.MjData(self._model)

    def at(self, position_rad: Sequence[float]) -> list[LinkPose]:
        """Return base and links, from the foot to the flange, at seven axis positions."""
        self._data.qpos[:] = position_rad
        mujoco.mj_kinematics(self._model, self._data)
        places, turns = self._data.xpos[:LINKS].tolist(), self._data.xquat[:LINKS].tolist()
        return [LinkPose(tuple(place), tuple(turn)) for place, turn in zip(places, turns, strict=True)]

    def flange_m(self) -> Three:
        """Return where the flange's origin is in the robot base at the position asked for last."""
        x, y, z = self._data.site(FLANGE).xpos.tolist()
        return x, y, z
