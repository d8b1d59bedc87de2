"""What every control law offers."""

from typing import Protocol

from hil.core.control.dynamics import Dynamics
from hil.core.motion.set_point import SetPoint
from hil.values.robot import Seven


class ControlLaw(Protocol):
    """One law; it is asked once a control cycle, after ``dynamics`` was updated with the measured state.

    A law has no memory of the torque it gave: taking over from another one steps by the difference of the two laws at
    that state, and so does a change of its own settings.
    """

    def torque_nm(self, set_point: SetPoint, dynamics: Dynamics, *, now_ns: int) -> Seven:
        """Return what the seven motors must give, in Nm, positive towards plus: gravity and all is in it."""
