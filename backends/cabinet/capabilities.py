"""What a Cabinet lets this controller do, by the overlay of its motion."""

from hil.values.arm import Capabilities
from hil.values.fri import OverlayKind
from hil.values.robot import JOINT_COUNT


def capabilities(overlay: OverlayKind) -> Capabilities:
    """Return what there is under ``overlay``; control laws, drives, mode and enabling are the Cabinet's own."""
    return Capabilities(
        joint_count=JOINT_COUNT,
        takes_torque=False,
        torque_sigma_nm=None,
        can_be_pushed=False,
        shortest_period_ns=1_000_000,
        paces_the_cycle=True,
        moves_real_drives=True,
        switches_drives=False,
        passes_overlays=frozenset({overlay} - {OverlayKind.JOINT_POSITION}),
        has_own_operator=True,
    )
