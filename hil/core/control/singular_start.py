"""Where Cartesian impedance cannot begin: in a singularity of the whole arm, whatever begins it."""

from hil.core.control.load_validation import SINGULAR_RAD
from hil.core.kinematics.singularities import Singularity
from hil.core.kinematics.srs import SrsKinematics
from hil.values.arm import ArmState
from hil.values.control import ControlSetup
from hil.values.fri import ControlMode


def singular_start(setup: ControlSetup, arm: ArmState, kinematics: SrsKinematics) -> Singularity | None:
    """Return the singularity that keeps ``setup`` from beginning where the arm is, or None."""
    if setup.kind is not ControlMode.CARTESIAN_IMPEDANCE:
        return None
    singular = kinematics.singularities_of(arm.position_rad, tolerance_rad=SINGULAR_RAD)
    return singular[0] if any(one.whole_arm for one in singular) else None
