"""Short ways to motions for tests."""

from hil.core.motion.executive import MotionExecutive
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.robot import Seven


def proposed(executive: MotionExecutive, *, measured_rad: Seven = STILL, now_ns: int = 0) -> SetPoint:
    """Return the set point the executive proposes for a cycle; fail on a fault."""
    set_point = executive.propose(measured_rad=measured_rad, now_ns=now_ns, started_ns=now_ns)
    assert isinstance(set_point, SetPoint), set_point
    return set_point
