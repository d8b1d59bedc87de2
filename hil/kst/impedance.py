"""The impedance mode: SmartServo to the newest joint set-point, on Cartesian springs (kst-wire 4.6, 4.7)."""

from hil.kst.context import Context
from hil.kst.jobs import Ended, ImpedanceServo, Outcome


async def impedance_servo(_context: Context, _job: ImpedanceServo) -> Ended:
    """Refuse, until the servo link knows tools that a program attaches."""
    return Ended(Outcome.FAILED, "impedance is not there yet")
