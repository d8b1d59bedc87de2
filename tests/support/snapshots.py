"""States of a robot at rest, for what only draws them."""

from hil.values.fri import ControlMode
from hil.values.pose import NOWHERE
from hil.values.servo import Snapshot, Vector
from tests.support.servo_controller import RUNNING

_STILL = (0.0,) * 7


def snapshot_at(position_rad: Vector) -> Snapshot:
    """Return the state of a robot that stands there; where its flange is, is not reckoned."""
    return Snapshot(
        *(0, 0, RUNNING, position_rad, position_rad, _STILL, _STILL, NOWHERE, ControlMode.POSITION),
        *(_STILL, _STILL[:6], _STILL[:6], "", ()),
    )
