"""Joint impedance: each axis a spring to its set point, damped with the whole arm's inertia, gravity compensated.

The axes are coupled by the inertia, so a damping ratio belongs to the oscillators of the arm on its seven springs, not
to an axis by itself: see :mod:`hil.core.control.modes`. The planned motion is fed forward.
"""

import numpy as np

from hil.core.control.dynamics import Dynamics
from hil.core.control.modes import Modes
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.arm import seven
from hil.values.control import JointImpedanceControlMode
from hil.values.robot import JOINT_COUNT, Seven


class JointImpedanceLaw:
    """Seven springs. ``overlay_nm`` is what a torque overlay adds. An axis without stiffness has no damping either."""

    def __init__(self, settings: JointImpedanceControlMode) -> None:
        self.overlay_nm: Seven = STILL
        self._modes = Modes(JOINT_COUNT, np.array(settings.damping))
        self._stiffness = self._root = np.empty(JOINT_COUNT)
        self._outer = np.empty((JOINT_COUNT, JOINT_COUNT))
        self._scaled = np.empty((JOINT_COUNT, JOINT_COUNT))
        self._torque = np.empty(JOINT_COUNT)
        self.change(settings)

    def change(self, settings: JointImpedanceControlMode) -> None:
        """Take other settings from the next cycle on; the torque steps by what they differ in, and by no more."""
        self._stiffness = np.array(settings.stiffness_nm_rad)
        self._root = np.sqrt(self._stiffness)
        self._outer = np.outer(self._root, self._root)
        self._modes.set_damping(np.array(settings.damping))

    def torque_nm(self, set_point: SetPoint, dynamics: Dynamics, *, now_ns: int) -> Seven:  # noqa: ARG002  # of the contract
        """See :class:`hil.core.control.law.ControlLaw`."""
        position, velocity, acceleration = set_point
        numbers = np.array(position + velocity + acceleration)
        error, rate, planned = numbers[:7], numbers[7:14], numbers[14:]
        ahead = dynamics.feed_forward(rate, planned) if any(velocity) or any(acceleration) else dynamics.gravity_nm
        error -= dynamics.position_rad
        error *= self._stiffness
        rate -= dynamics.velocity_rad_s
        rate *= self._root
        np.multiply(self._outer, dynamics.inverse_mass(), out=self._scaled)
        self._modes.solve(self._scaled)
        torque = self._torque
        self._modes.damping_force(rate, torque)
        torque *= self._root
        torque += error
        torque += ahead
        friction = dynamics.friction_nm()
        if friction is not None:
            torque += friction
        if self.overlay_nm is not STILL:
            torque += self.overlay_nm
        return seven(torque.tolist())
