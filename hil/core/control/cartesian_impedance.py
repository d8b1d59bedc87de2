"""Cartesian impedance: the TCP on springs to its set point, the elbow on one of its own, gravity compensated.

Along and about the axes of the set point's TCP frame, in which stiffness, force and deviation are told. The inertia
stays the arm's own (no shaping), the planned motion is fed forward. Damping: :mod:`hil.core.control.modes`.

Null space: a spring of every axis to the set point's axis positions and a damper, both let through only as far as they
do not accelerate the TCP (dynamically consistent projection, Khatib 1987, IEEE J-RA 3(1)). With J = sqrt(K) times the
Jacobian and B = diag(1/w) V' J inv(M), what is left of the inverse mass matrix is N = inv(M) - B'B, of rank one in a
regular pose; a torque t passes as M N t, and its trace is the mobility the null space damping is reckoned with. A
projected spring has no potential, so unlike the rest it is not passive by construction (Ott 2008, STAR 49).
"""

from typing import TYPE_CHECKING, Final

import numpy as np
import pinocchio

from hil.core.control.cartesian_limits import CartesianLimits, CartesianReading, LimitViolation
from hil.core.control.dynamics import Dynamics, Goal
from hil.core.control.modes import Modes
from hil.core.control.orientation import rotation_vector, spring_moment
from hil.core.control.oscillation import Oscillation
from hil.core.motion.set_point import SetPoint
from hil.values.arm import seven
from hil.values.control import (
    OFF,
    CartesianImpedanceControlMode,
    CartesianSineImpedanceControlMode,
    ForceOscillation,
    six,
)
from hil.values.robot import JOINT_COUNT, Seven, Six

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_ORDER: Final = [0, 1, 2, 5, 4, 3]
"""From X Y Z A B C to x, y, z and the turns about x, y, z; and back."""
_LEAST_STIFFNESS: Final = 1.0
"""N/m or Nm/rad that a softer axis counts with where its inertia is reckoned; its spring and damper stay as set."""
_NONE: Final[Six] = (0.0,) * 6
_DIAGONAL: Final = np.eye(JOINT_COUNT)


class CartesianImpedanceLaw:
    """Six springs and one; with a :class:`CartesianSineImpedanceControlMode` a force oscillation over them.

    An axis without stiffness has no damping either, and the null space likewise.
    """

    def __init__(self, settings: CartesianImpedanceControlMode | CartesianSineImpedanceControlMode) -> None:
        self._overlay: Six = _NONE
        self._oscillation: Oscillation | None = None
        self._modes = Modes(6, np.ones(6))
        self._turn = np.zeros((6, 6))
        self._turn_linear, self._turn_angular = self._turn[:3, :3], self._turn[3:, 3:]
        self._turned_to: Goal | None = None
        self._scaled = np.empty((6, JOINT_COUNT))
        self._mobile = np.empty((6, JOINT_COUNT))
        self._mobility = np.empty((6, 6))
        self._weighted = np.empty((6, 6))
        self._rest = np.empty((JOINT_COUNT, JOINT_COUNT))
        self._rate = np.empty(6)
        self._damping = np.empty(6)
        self._force = np.empty(6)
        self._torque = np.empty(JOINT_COUNT)
        self._pull = np.empty(JOINT_COUNT)
        self._share = np.empty(JOINT_COUNT)
        self._deviation: tuple[float, ...] = _NONE
        self.change(settings)

    def change(self, settings: CartesianImpedanceControlMode | CartesianSineImpedanceControlMode) -> None:
        """Take other settings from the next cycle on; the torque steps by what they differ in, and by no more.

        An oscillation goes on where it is; one that is new begins, one that is no longer there ends.
        """
        if isinstance(settings, CartesianSineImpedanceControlMode):
            self._superpose(settings.oscillation)
            self._take(settings.impedance)
        else:
            self._superpose(None)
            self._take(settings)

    def _add_up(self) -> None:
        """Set what is constant on top of the springs, in the law's own order."""
        added = [self._additional[axis] + self._overlay[axis] for axis in _ORDER]
        self._added: list[float] | None = added if any(added) else None

    def _superpose(self, oscillation: ForceOscillation | None) -> None:
        if oscillation is None:
            self._oscillation = None
        elif self._oscillation is None:
            self._oscillation = Oscillation(oscillation)
        else:
            self._oscillation.change(oscillation)

    def _take(self, settings: CartesianImpedanceControlMode) -> None:
        stiffness = np.array(settings.stiffness)[_ORDER]
        kx, ky, kz, krx, kry, krz = stiffness.tolist()
        self._along, self._about = (kx, ky, kz), (krx, kry, krz)
        root = np.sqrt(np.maximum(stiffness, _LEAST_STIFFNESS))
        self._per_root = 1.0 / root
        roots = np.repeat(root[:, np.newaxis], 3, axis=1)
        self._roots_linear, self._roots_angular = roots[:3], roots[3:]
        self._turned_to = None
        true = np.sqrt(stiffness) / root
        self._true_share: Array | None = true if true.min() < 1.0 else None
        self._modes.set_damping(np.array(settings.damping)[_ORDER])
        self._elbow_stiffness = settings.null_space_stiffness_nm_rad
        self._elbow_ratio = settings.null_space_damping
        self._additional = settings.additional_control_force
        self._add_up()
        maximum = np.array(settings.max_control_force)[_ORDER]
        self._most: Array | None = maximum if maximum.min() < OFF else None
        self._limits = CartesianLimits(settings)

    def torque_nm(self, set_point: SetPoint, dynamics: Dynamics, *, now_ns: int) -> Seven:
        """See :class:`hil.core.control.law.ControlLaw`."""
        goal = dynamics.goal(set_point)
        scaled, rate, force = self._scaled, self._rate, self._force
        if goal is not self._turned_to:
            self._turn_to(goal)
        self._turn.dot(dynamics.jacobian(), scaled)
        scaled.dot(dynamics.velocity_rad_s, rate)
        if goal.twist is not None:
            rate -= self._turn.dot(goal.twist)
        self._solve(dynamics.inverse_mass())
        self._damping_force(rate)
        force[:] = self._spring_force(goal.placement.actInv(dynamics.placement()), now_ns)
        force *= self._per_root
        force -= self._damping
        if self._most is not None:
            most = self._most * self._per_root
            np.clip(force, -most, most, out=force)
        torque = self._torque
        force.dot(scaled, torque)
        self._hold_elbow(goal, dynamics)
        torque += self._pull
        if goal.twist is None and not any(set_point.acceleration_rad_s2):
            torque += dynamics.gravity_nm
        else:
            torque += dynamics.feed_forward(goal.velocity_rad_s, goal.acceleration_rad_s2)
        friction = dynamics.friction_nm()
        if friction is not None:
            torque += friction
        return seven(torque.tolist())

    @property
    def overlay_force(self) -> Six:
        """What a wrench overlay adds, N and Nm, X Y Z A B C of the set point's TCP; zero unless set."""
        return self._overlay

    @overlay_force.setter
    def overlay_force(self, force: Six) -> None:
        self._overlay = force
        self._add_up()

    def reading(self, set_point: SetPoint, dynamics: Dynamics) -> CartesianReading:
        """Return force, deviation and velocity of the cycle that :meth:`torque_nm` was last asked in."""
        twist = dynamics.jacobian().dot(dynamics.velocity_rad_s)
        velocity = twist.reshape(2, 3).dot(dynamics.goal(set_point).rotation).reshape(6)[_ORDER]
        velocity[:3] *= 1e3
        force = (self._force / self._per_root)[_ORDER]
        return CartesianReading(six(force.tolist()), self._deviation_mm_rad(self._deviation), six(velocity.tolist()))

    def violation(self, set_point: SetPoint, dynamics: Dynamics) -> LimitViolation | None:
        """Return the first limit of the settings that does not hold in this cycle; at once None where none is set."""
        if not self._limits.watching:
            return None
        return self._limits.first_violation(self.reading(set_point, dynamics))

    def _turn_to(self, goal: Goal) -> None:
        """Set the matrix that brings a twist from base axes to those of the goal, times the roots of the stiffness."""
        inverse = goal.rotation.T
        np.multiply(self._roots_linear, inverse, out=self._turn_linear)
        np.multiply(self._roots_angular, inverse, out=self._turn_angular)
        self._turned_to = goal

    @staticmethod
    def _deviation_mm_rad(deviation: tuple[float, ...]) -> Six:
        x, y, z, rx, ry, rz = deviation
        return (1e3 * x, 1e3 * y, 1e3 * z, rz, ry, rx)

    def _spring_force(self, error: "pinocchio.SE3", now_ns: int) -> list[float]:
        """Return springs and what is added to them, in the law's own order, for the TCP as the set point sees it."""
        x, y, z, qx, qy, qz, qw = pinocchio.SE3ToXYZQUATtuple(error)
        theta = rotation_vector(qx, qy, qz, qw)
        self._deviation = (x, y, z, *theta)
        kx, ky, kz = self._along
        forces = [-kx * x, -ky * y, -kz * z, *spring_moment(theta, self._about)]
        if self._added is not None:
            forces = [force + added for force, added in zip(forces, self._added, strict=True)]
        if self._oscillation is not None:
            swing = self._oscillation.force(self._deviation_mm_rad(self._deviation), now_ns=now_ns)
            forces = [forces[axis] + swing[_ORDER[axis]] for axis in range(6)]
        return forces

    def _solve(self, inverse_mass: "Array") -> None:
        """Find the oscillators of the TCP on its springs, and the inverse mass matrix the springs do not see."""
        scaled, mobile, modes = self._scaled, self._mobile, self._modes
        scaled.dot(inverse_mass, mobile)
        mobile.dot(scaled.T, self._mobility)
        modes.solve(self._mobility)
        np.divide(modes.vectors, modes.frequency_rad_s, out=self._weighted)
        seen = self._weighted.T.dot(mobile)
        np.dot(seen.T, seen, out=self._rest)
        np.subtract(inverse_mass, self._rest, out=self._rest)

    def _damping_force(self, rate: "Array") -> None:
        true = self._true_share
        if true is None:
            self._modes.damping_force(rate, self._damping)
        else:
            self._modes.damping_force(rate * true, self._damping)
            self._damping *= true

    def _hold_elbow(self, goal: Goal, dynamics: Dynamics) -> None:
        """Set the pull of the null space."""
        rest, mass, pull, share = self._rest, dynamics.mass_kg_m2, self._pull, self._share
        np.subtract(goal.velocity_rad_s, dynamics.velocity_rad_s, out=share)
        mass.dot(share, pull)
        mobility = max(float(np.vdot(rest, _DIAGONAL)), 0.0)
        pull *= 2.0 * self._elbow_ratio * (self._elbow_stiffness * mobility) ** 0.5
        np.subtract(goal.position_rad, dynamics.position_rad, out=share)
        share *= self._elbow_stiffness
        pull += share
        rest.dot(pull, share)
        mass.dot(share, pull)
