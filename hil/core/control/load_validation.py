"""Whether the load that was told is the one that hangs on the flange: what the torque sensors show of an arm at rest.

Manual 7.10.1 asks for such a validation before impedance control, in a pose that is no singularity; how it judges is
not public. Ours: at rest every joint's measured torque is nearly what gravity asks for with the load told.
"""

from typing import Final

from hil.core.control.dynamics import Dynamics
from hil.core.kinematics.srs import SrsKinematics
from hil.values.arm import ArmState
from hil.values.load import Load
from hil.values.robot import JOINT_NAMES, JointLimits

SINGULAR_RAD: Final = 0.05
"""How near to a singularity an axis may be: nearer, sensors and model say little of one direction."""
AT_REST_RAD_S: Final = 0.02
"""An arm that has just reached the end of a PTP still settles; friction and inertia are within the offset then."""
SHARE_OF_TORQUE: Final = 0.005
OFFSET_NM: Final = 0.6
"""What may be left over of a joint: half a percent of its largest torque, and this, which covers its dry friction
(facts 4.1) and the sensors' noise (4.4). Half a kilogram at 0.8 m is 4 Nm."""


class LoadValidation:
    """Remembers which loads were found to be true, since :meth:`forget`."""

    def __init__(self, *, dynamics: Dynamics, kinematics: SrsKinematics, limits: JointLimits) -> None:
        self._dynamics = dynamics
        self._kinematics = kinematics
        self._allowed_nm = [OFFSET_NM + SHARE_OF_TORQUE * most for most in limits.torque_nm]
        self._valid: set[Load] = set()

    def forget(self) -> None:
        """Another application must validate for itself."""
        self._valid.clear()

    def holds(self, load: Load) -> bool:
        """Whether this load was found to be true."""
        return load in self._valid

    def validate(self, load: Load, arm: ArmState) -> str:
        """Return why ``load`` (in the flange) is not what the sensors show, or an empty text; it is remembered."""
        self._valid.discard(load)
        singular = self._kinematics.singularities_of(arm.position_rad, tolerance_rad=SINGULAR_RAD)
        if singular:
            return (
                f"the arm is in a singularity ({singular[0]}): move it to another pose with a PTP, and validate again"
            )
        fastest = max(map(abs, arm.velocity_rad_s))
        if fastest > AT_REST_RAD_S:
            return f"the arm moves with {fastest:.3f} rad/s: the load can only be validated at rest"
        before = self._dynamics.load
        self._dynamics.set_load(load)
        self._dynamics.update(arm.position_rad, arm.velocity_rad_s)
        left_nm = [
            shown + needed for shown, needed in zip(arm.torque_nm, self._dynamics.gravity_nm.tolist(), strict=True)
        ]
        self._dynamics.set_load(before)
        self._dynamics.update(arm.position_rad, arm.velocity_rad_s)
        over = [abs(left) / allowed for left, allowed in zip(left_nm, self._allowed_nm, strict=True)]
        axis = max(range(len(over)), key=over.__getitem__)
        if over[axis] > 1.0:
            return (
                f"the load of {load.mass_kg:g} kg that was told does not explain the torques: {JOINT_NAMES[axis]} "
                f"shows {left_nm[axis]:+.2f} Nm beside it, {self._allowed_nm[axis]:.2f} Nm are allowed; tell the load "
                f"that hangs on the flange, or take off what pushes the arm"
            )
        self._valid.add(load)
        return ""
