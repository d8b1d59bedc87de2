"""The suite of all backends, over seven simulated drives."""

from backends.contract import DrivesContract, PeerContract
from backends.rig import Rig
from backends.robots import load_description
from hil.clock import elapsed_ns
from tools.conformance.simulated_drives import SimulatedDrivesRig


class TestCan402(DrivesContract, PeerContract):
    elapsed_ns = staticmethod(elapsed_ns)
    period_ns = 4_000_000
    far_rad = 0.1  # beyond 0.2 rad the drives themselves report a following error

    def make_rig(self) -> Rig:
        return SimulatedDrivesRig(load_description("lbr-iiwa-7-r800"))
