"""External joint torques by a generalised momentum observer.

Source: De Luca, Mattone 2005, "Sensorless robot collision detection and hybrid force/motion control", ICRA, p. 999. The
momentum of the links changes by measured torque, bias and whatever pushes; the observer follows that rest as a
low-pass of first order, without measuring an acceleration. The change of momentum in a cycle that is due to the mass
matrix itself is left out on both sides, so no Coriolis matrix is needed.

The sensors sit on the link side of the gear (facts 4.4), so the motors' inertia is not in the balance. The friction of
the link is behind the sensor: while a joint moves it is reckoned with, at rest up to the dry friction of each joint
(0.03 to 0.32 Nm, facts 4.1) looks like a push. An error of the load told, too, looks like a push.
"""

import math
from collections.abc import Sequence
from operator import add, sub
from struct import Struct
from typing import TYPE_CHECKING, Final

import numpy as np

from hil.core.control.dynamics import Dynamics
from hil.core.motion.set_point import STILL
from hil.values.arm import ArmState, seven
from hil.values.robot import JOINT_COUNT, Seven

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_CHANGE: Final = Struct(f"{JOINT_COUNT}d")
BANDWIDTH_HZ: Final = 10.0
"""Of the observer. Ours; 10 Hz is what drivers in the field filter with (facts 4.4)."""


class MomentumObserver:
    """Asked once a cycle, after ``dynamics`` was updated with the same state; a new measurement each cycle.

    ``sensor_sigma_nm`` is the standard deviation of the torque sensors, which the variance follows from.
    """

    def __init__(
        self,
        *,
        sensor_sigma_nm: Seven,
        bandwidth_hz: float = BANDWIDTH_HZ,
    ) -> None:
        self._rate = 2.0 * math.pi * bandwidth_hz
        self._sigma2: Array = np.square(np.array(sensor_sigma_nm))
        self._external: Seven = STILL
        self._velocity: Sequence[float] = STILL
        self._change = np.zeros(JOINT_COUNT)
        self._change_memory = self._change.data.cast("B")
        self._last_ns: int | None = None
        self._share = self._variance_of = 0.0
        self._variance: Seven = seven((0.0 * self._sigma2).tolist())

    @property
    def external_nm(self) -> Seven:
        """The newest estimate, positive when the environment pushes a joint towards plus."""
        return self._external

    @property
    def variance_nm2(self) -> Seven:
        """Variance of the estimate due to the sensors' noise; friction and a wrong model are not in it."""
        share = self._share
        if share != self._variance_of:
            self._variance_of, self._variance = share, seven((share / (2.0 - share) * self._sigma2).tolist())
        return self._variance

    def reset(self) -> None:
        """Forget what was seen, as after an interruption of the measurement; the estimate begins at zero again."""
        self._external = STILL
        self._last_ns = None

    def update(self, state: ArmState, dynamics: Dynamics, *, now_ns: int) -> Seven:
        """Take the measured torque of a cycle and return the new estimate, Nm."""
        last_ns, self._last_ns = self._last_ns, now_ns
        before, self._velocity = self._velocity, dynamics.velocity_rad_s.tolist()
        if last_ns is None or now_ns <= last_ns:
            return self._external
        elapsed_s = (now_ns - last_ns) * 1e-9
        # The sign of the sensors is minus that of the actuation, so measured torque and bias add.
        balance = list(map(add, dynamics.bias_nm.tolist(), state.torque_nm))
        friction = dynamics.friction_nm()
        if friction is not None:
            balance = list(map(add, balance, friction.tolist()))
        change = list(map(sub, self._velocity, before))
        _CHANGE.pack_into(self._change_memory, 0, *change)
        gain = self._rate / (1.0 + self._rate * elapsed_s)
        self._share = gain * elapsed_s
        # Seven numbers one by one: a dozen array operations on them cost twice as much.
        self._external = seven(
            [
                external + ((torque - external) * elapsed_s + gained - changed * motor) * gain
                for torque, external, gained, changed, motor in zip(
                    balance,
                    self._external,
                    dynamics.mass_kg_m2.dot(self._change).tolist(),
                    change,
                    dynamics.armature_kg_m2.tolist(),
                    strict=True,
                )
            ]
        )
        return self._external
