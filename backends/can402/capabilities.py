"""What drives on a CAN bus can do."""

from hil.values.arm import Capabilities
from hil.values.robot import JOINT_COUNT


def capabilities(*, simulated: bool) -> Capabilities:
    """Positions, and drives that can be dropped; no torques, and nothing that feels what pushes the arm."""
    return Capabilities(
        joint_count=JOINT_COUNT,
        takes_torque=False,
        torque_sigma_nm=None,
        can_be_pushed=False,
        shortest_period_ns=1_000_000,
        paces_the_cycle=False,
        moves_real_drives=not simulated,
        switches_drives=True,
    )
