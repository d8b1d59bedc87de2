"""The control stage of the cycle: set point and measured state in, command for the robot side out.

Position control is the robot side's own: it gets the set point. The other modes are laws of torque, computed here. What
pushes the arm is estimated here too, from what the torque sensors show, with the load that was told.
"""

from typing import TYPE_CHECKING, Final, assert_never

from hil.core.control.cartesian_impedance import CartesianImpedanceLaw
from hil.core.control.dynamics import Dynamics
from hil.core.control.joint_impedance import JointImpedanceLaw
from hil.core.estimation.flange_force import FlangeForce, FlangeForceEstimator
from hil.core.estimation.momentum_observer import MomentumObserver
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.arm import ArmState, JointCommand, OverlayCommand
from hil.values.control import (
    NO_WRENCH,
    CartesianImpedanceControlMode,
    CartesianSineImpedanceControlMode,
    ControlModeSettings,
    ControlSetup,
    JointImpedanceControlMode,
    PositionControlMode,
)
from hil.values.motion import Fault
from hil.values.robot import Seven, Six
from hil.values.tuples import new_tuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from hil.core.motion.executive import MotionExecutive

    Array = NDArray[np.float64]

ESTIMATE_NS: Final = 4_000_000
"""How often what pushes the arm is estimated while the robot side controls it; under a law it is in each cycle. Ours:
a twenty-fifth of the observer's own period, so that it costs little and shows nothing less."""

Law = JointImpedanceLaw | CartesianImpedanceLaw
_CARTESIAN: Final = (CartesianImpedanceControlMode, CartesianSineImpedanceControlMode)


class ControlStage:
    """One arm. ``sensor_sigma_nm`` is the noise of its torque sensors; None: it has none, and nothing is estimated.

    Without ``runs_laws`` the robot side computes its own, and is handed what an overlay adds.
    """

    def __init__(self, dynamics: Dynamics, *, sensor_sigma_nm: Seven | None, runs_laws: bool = True) -> None:
        self._dynamics = dynamics
        self._runs_laws = runs_laws
        self._observer = None if sensor_sigma_nm is None else MomentumObserver(sensor_sigma_nm=sensor_sigma_nm)
        self._force = FlangeForceEstimator()
        self._setup = ControlSetup()
        self._motion: object = None
        self._law: Law | None = None
        self._external: Seven = STILL
        self._estimate_at_ns = 0
        self._updated_ns = -1
        self._arm: ArmState | None = None
        self.violation: Fault | None = None
        """Which Cartesian limit of the running mode did not hold in the last cycle."""

    def read(self, arm: ArmState, *, now_ns: int) -> ArmState:
        """Return a measured state with what pushes the arm, where its sensors tell; to be called once a cycle."""
        observer = self._observer
        self._arm = arm
        if observer is None:
            if self._law is not None:
                self._update(arm, now_ns)
            return arm
        if self._law is not None or now_ns >= self._estimate_at_ns:
            self._estimate_at_ns = now_ns + ESTIMATE_NS
            self._update(arm, now_ns)
            self._external = observer.update(arm, self._dynamics, now_ns=now_ns)
        position, velocity, torque, _, commanded, drives, sample = arm
        return new_tuple(ArmState, (position, velocity, torque, self._external, commanded, drives, sample))

    def command(self, set_point: SetPoint, motion: "MotionExecutive", *, now_ns: int) -> JointCommand:
        """Return the command that leads the arm to ``set_point`` as what has the arm wants it controlled."""
        setup = motion.control
        if setup is not self._setup or motion.control_of is not self._motion:
            self._take(setup, motion.control_of)
        law = self._law
        if law is None:
            position, velocity, acceleration = set_point
            if not self._runs_laws and setup.yields:
                overlay = OverlayCommand(motion.overlay_torque_nm, motion.overlay_wrench)
                return JointCommand(position, velocity, acceleration, overlay=overlay)
            return new_tuple(JointCommand, (position, velocity, acceleration, None, None))
        if self._updated_ns != now_ns:
            # The law is new: the state of this cycle was read before anybody needed it.
            self._update(self._arm, now_ns)
        if isinstance(law, JointImpedanceLaw):
            law.overlay_nm = motion.overlay_torque_nm
        else:
            law.overlay_force = motion.overlay_wrench
        torque = law.torque_nm(set_point, self._dynamics, now_ns=now_ns)
        self.violation = self._violation(law, set_point)
        position, velocity, acceleration = set_point
        return JointCommand(position, velocity, acceleration, torque)

    def _violation(self, law: Law, set_point: SetPoint) -> Fault | None:
        if not isinstance(law, CartesianImpedanceLaw):
            return None
        violation = law.violation(set_point, self._dynamics)
        return None if violation is None else Fault(f"{violation.name} exceeded", str(violation))

    def flange_force(self, arm: ArmState, *, now_ns: int) -> FlangeForce:
        """Return what pushes the flange, as far as its joints show it."""
        self._update(arm, now_ns)
        return self._force.estimate(arm.external_torque_nm, self.external_variance_nm2, self._dynamics)

    def flange_wrench(self, arm: ArmState, *, now_ns: int) -> Six:
        """Return that force alone, for those who tell nothing else of it."""
        external = arm.external_torque_nm
        if not any(external):
            return NO_WRENCH
        return self._force.wrench(external, self._flange_jacobian(arm, now_ns))

    def flange_wrench_and_variance(self, arm: ArmState, *, now_ns: int) -> tuple[Six, Six]:
        """Return that force and its variance alone."""
        external, variance = arm.external_torque_nm, self.external_variance_nm2
        if not (any(external) or any(variance)):
            return NO_WRENCH, NO_WRENCH
        return self._force.wrench_and_variance(external, variance, self._flange_jacobian(arm, now_ns))

    def _flange_jacobian(self, arm: ArmState, now_ns: int) -> "Array":
        # Where nothing else needs the dynamics in this cycle, the Jacobian is had for less.
        if now_ns == self._updated_ns:
            return self._dynamics.flange_jacobian()
        return self._dynamics.flange_jacobian_at(arm.position_rad)

    @property
    def external_variance_nm2(self) -> Seven:
        """Variance of the estimated external torque, Nm2, due to the noise of the sensors."""
        return STILL if self._observer is None else self._observer.variance_nm2

    @property
    def dynamics(self) -> Dynamics:
        """The arm with the load that was told, at the last state that was needed."""
        return self._dynamics

    def _update(self, arm: ArmState | None, now_ns: int) -> None:
        if now_ns != self._updated_ns and arm is not None:
            self._updated_ns = now_ns
            self._dynamics.update(arm.position_rad, arm.velocity_rad_s)

    def _take(self, setup: ControlSetup, motion: object) -> None:
        before, self._setup = self._setup, setup
        self.violation = None
        if setup.load != before.load:
            self._dynamics.set_load(setup.load)
        if setup.tcp_in_flange != before.tcp_in_flange:
            self._dynamics.set_tcp(setup.tcp_in_flange)
        if setup.load != before.load or setup.tcp_in_flange != before.tcp_in_flange:
            self._updated_ns = -1
        mode, same_motion = setup.mode, motion is self._motion
        self._motion = motion
        if not (same_motion and _changed(self._law, mode)):
            self._law = _law(mode) if self._runs_laws else None


def _changed(law: Law | None, mode: ControlModeSettings) -> bool:
    """Let ``law`` go on with other parameters, if ``mode`` is its own; return whether it is."""
    if isinstance(law, JointImpedanceLaw) and isinstance(mode, JointImpedanceControlMode):
        law.change(mode)
        return True
    if isinstance(law, CartesianImpedanceLaw) and isinstance(mode, _CARTESIAN):
        law.change(mode)
        return True
    return False


def _law(mode: ControlModeSettings) -> Law | None:
    match mode:
        case PositionControlMode():
            return None
        case JointImpedanceControlMode():
            return JointImpedanceLaw(mode)
        case CartesianImpedanceControlMode() | CartesianSineImpedanceControlMode():
            return CartesianImpedanceLaw(mode)
        case _:
            assert_never(mode)
