"""The backend contract, passed by the link to a Cabinet: our own controller, over the ideal and the simulated arm."""

from functools import partial

from backends.contract import PeerContract
from backends.mujoco import MujocoBackend
from backends.rig import Rig
from hil.clock import elapsed_ns
from hil.values.fri import Release
from tools.conformance.chained_cabinet import ChainedCabinetRig


class TestCabinetOfAnIdealArm(PeerContract):
    elapsed_ns = staticmethod(elapsed_ns)

    def make_rig(self) -> Rig:
        return ChainedCabinetRig()


class TestCabinetOfASimulatedArm(PeerContract):
    elapsed_ns = staticmethod(elapsed_ns)

    def make_rig(self) -> Rig:
        return ChainedCabinetRig(arm=partial(MujocoBackend, torque_noise=False), release=Release.V2_7)
