"""The position controller of the MuJoCo backend as a law, for tests without a backend; a test holds the two equal."""

from typing import Final

import numpy as np

from hil.core.control.dynamics import Dynamics
from hil.core.motion.set_point import SetPoint
from hil.values.arm import seven
from hil.values.robot import JOINT_COUNT, Seven

LOOP_FREQUENCY_RAD_S: Final = 150.0
"""Natural frequency of the position loop. Ours: 20 N at the flange deflect no robot by 0.2 mm in a regular pose, and at
1 kHz the discrete loop is well damped; at 5 ms it is still stable, from 6.6 ms on it is not."""


class PositionLaw:
    """The stiff arm."""

    def __init__(self, *, loop_frequency_rad_s: float = LOOP_FREQUENCY_RAD_S) -> None:
        self._spring = loop_frequency_rad_s * loop_frequency_rad_s
        self._damper = 2.0 * loop_frequency_rad_s
        self._torque = np.empty(JOINT_COUNT)

    def torque_nm(self, set_point: SetPoint, dynamics: Dynamics, *, now_ns: int) -> Seven:  # of the contract
        """See :class:`hil.core.control.law.ControlLaw`."""
        numbers = np.array(set_point.position_rad + set_point.velocity_rad_s + set_point.acceleration_rad_s2)
        acceleration, rate, planned = numbers[:7], numbers[7:14], numbers[14:]
        acceleration -= dynamics.position_rad
        acceleration *= self._spring
        rate -= dynamics.velocity_rad_s
        rate *= self._damper
        acceleration += rate
        acceleration += planned
        torque = self._torque
        dynamics.mass_kg_m2.dot(acceleration, torque)
        torque += dynamics.bias_nm
        return seven(torque.tolist())
