"""The suite of all backends, over the arms that live in this process."""

import pytest

from backends.contract import DrivesContract
from backends.ideal import IdealBackend
from backends.mujoco import MujocoBackend
from backends.rig import InProcessRig, Rig
from backends.robots import load_description, robot_names
from hil.clock import elapsed_ns


class _EveryRobot(DrivesContract):
    elapsed_ns = staticmethod(elapsed_ns)
    still_rad_s = 1e-4
    robot = ""

    @pytest.fixture(autouse=True, params=robot_names())
    def _robot(self, request: pytest.FixtureRequest) -> None:
        self.robot = request.param


class TestIdeal(_EveryRobot):
    def make_rig(self) -> Rig:
        return InProcessRig(IdealBackend(load_description(self.robot)))


class TestMujoco(_EveryRobot):
    def make_rig(self) -> Rig:
        return InProcessRig(MujocoBackend(load_description(self.robot)))
