"""How an application may have its motions controlled: mode, load and TCP of the frame it moves."""

from hil.core.control.load_validation import LoadValidation
from hil.core.control.singular_start import singular_start
from hil.core.kinematics.srs import SrsKinematics
from hil.core.servo.answer import Answer
from hil.values.arm import ArmState
from hil.values.control import ControlModeSettings, ControlSetup
from hil.values.errors import ConfigurationError, UnknownName
from hil.values.frames import FrameTree
from hil.values.load import Load
from hil.values.motion import Fault
from hil.values.servo import RequestError

NOT_VALIDATED = "the load model was not validated for impedance control (manual 7.10.1)"
KIND_STAYS = "the control type of a motion cannot be changed while it runs (manual 7.10.3)"


class ControlChoice:
    """Judges for one robot side, which either takes torques or does not."""

    def __init__(
        self,
        *,
        frames: FrameTree,
        kinematics: SrsKinematics,
        validation: LoadValidation,
        takes_torque: bool,
    ) -> None:
        self._frames = frames
        self._kinematics = kinematics
        self._validation = validation
        self._takes_torque = takes_torque

    def choose(self, mode: ControlModeSettings, frame: str, arm: ArmState) -> ControlSetup | Answer:
        """Return how a motion of ``frame`` is controlled; or why it is not."""
        load = self.load_of(frame)
        if isinstance(load, Answer):
            return load
        setup = ControlSetup(mode, load, self._frames.in_flange(frame))
        if not setup.yields:
            return setup
        if not self._takes_torque:
            return _refused(
                RequestError.ILLEGAL_STATE,
                "this robot side is position controlled only; impedance control needs torques",
            )
        if not self._validation.holds(load):
            detail = f"validate the load of {frame!r}, {load.mass_kg:g} kg, first"
            return _refused(RequestError.ILLEGAL_STATE, NOT_VALIDATED, detail)
        singular = singular_start(setup, arm, self._kinematics)
        if singular is not None:
            return _refused(
                RequestError.ILLEGAL_STATE,
                "Cartesian impedance control cannot begin in a singularity",
                f"{singular}; move the arm to another pose with a PTP",
            )
        return setup

    def change(self, control: ControlSetup, mode: ControlModeSettings) -> ControlSetup | Answer:
        """Return ``control`` with other parameters; or why it cannot have them."""
        if type(mode) is not type(control.mode):
            have, wanted = type(control.mode).__name__, type(mode).__name__
            return _refused(RequestError.ILLEGAL_ARGUMENT, KIND_STAYS, f"it is {have}, not {wanted}")
        return control._replace(mode=mode)

    def load_of(self, frame: str) -> Load | Answer:
        """Return the load that is reckoned with while ``frame`` is moved, in the flange."""
        try:
            self._frames.in_flange(frame)
        except (ConfigurationError, UnknownName) as error:
            return _refused(RequestError.ILLEGAL_ARGUMENT, str(error))
        return self._frames.load_of(frame)

    def validate(self, frame: str, arm: ArmState) -> str | Answer:
        """Return why the load of ``frame`` is not what hangs on the flange; empty when it is."""
        load = self.load_of(frame)
        return load if isinstance(load, Answer) else self._validation.validate(load, arm)

    def forget(self) -> None:
        """Another application commands; it must validate for itself."""
        self._validation.forget()


def _refused(error: RequestError, reason: str, detail: str = "") -> Answer:
    return Answer(error, Fault(reason, detail))
