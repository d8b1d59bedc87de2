"""The suite that every backend passes, over ours."""

import time

from elastic_arm import ElasticBackend, Options

from backends.contract import DrivesContract
from backends.rig import InProcessRig, Rig
from backends.robots import load_description


class TestElastic(DrivesContract):
    elapsed_ns = staticmethod(time.perf_counter_ns)

    def make_rig(self) -> Rig:
        return InProcessRig(ElasticBackend(load_description("lbr-iiwa-7-r800"), Options()))
