"""Whether the overlay of the robot application may begin, as far as its control mode has a say.

An arm that is to yield needs a load that is true, so the controller validates it as an application would (manual
7.10.1), once a session; and Cartesian impedance does not begin in a singularity of the whole arm.
"""

from typing import Final

from hil.core.control.load_validation import LoadValidation
from hil.core.control.singular_start import singular_start
from hil.core.kinematics.srs import SrsKinematics
from hil.values.arm import ArmState
from hil.values.control import ControlSetup

RETRY_NS: Final = 100_000_000
"""How long a refusal stands before the arm is looked at again. Ours."""


class OverlayGate:
    """One overlay, controlled as ``setup`` says."""

    def __init__(self, *, setup: ControlSetup, validation: LoadValidation, kinematics: SrsKinematics) -> None:
        self.setup = setup
        """What the arm is controlled with while the overlay runs."""
        self._validation = validation
        self._kinematics = kinematics
        self._refusal = ""
        self._asked_again_at_ns = 0

    def session_opened(self) -> None:
        """What was validated in the session before does not count."""
        self._validation.forget()
        self._refusal = ""

    def refusal(self, arm: ArmState, *, now_ns: int) -> str:
        """Return why the overlay may not begin, or an empty text."""
        if not self.setup.yields:
            return ""
        if not self._refusal or now_ns >= self._asked_again_at_ns:
            self._refusal = self._look(arm)
            self._asked_again_at_ns = now_ns + RETRY_NS
        return self._refusal

    def _look(self, arm: ArmState) -> str:
        load = self.setup.load
        if not self._validation.holds(load) and (reason := self._validation.validate(load, arm)):
            return f"the load of {load.mass_kg:g} kg could not be validated for impedance control: {reason}"
        singular = singular_start(self.setup, arm, self._kinematics)
        if singular is not None:
            return f"Cartesian impedance control cannot begin in a singularity ({singular}); move the arm away"
        return ""
