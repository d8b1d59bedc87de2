"""How an application may have its motions controlled: mode, load and TCP of the frame it moves."""

from hil.core.control.load_validation import LoadValidation
from hil.core.control.singular_start import singular_start
from hil.core.kinematics.srs import SrsKinematics
from hil.core.servo.answer import Answer
from hil.values.arm import ArmState
from hil.values.control import ControlModeSettings, ControlSetup
from hil.values.errors import ConfigurationError, UnknownName
from hil.values.frames import FrameTree
from hil.values.load import AttachedTool
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

    def choose(
        self, mode: ControlModeSettings, frame: str, tool: AttachedTool | None, arm: ArmState
    ) -> ControlSetup | Answer:
        """Return how a motion of ``frame``, or of a ``tool`` instead, is controlled; or why it is not."""
        moved = self.tool_of(frame, tool)
        if isinstance(moved, Answer):
            return moved
        load = moved.load
        setup = ControlSetup(mode, load, moved.tcp_in_flange)
        if not setup.yields:
            return setup
        if not self._takes_torque:
            return _refused(
                RequestError.ILLEGAL_STATE,
                "this robot side is position controlled only; impedance control needs torques",
            )
        if not self._validation.holds(load):
            whose = repr(frame) if tool is None else "the tool"
            detail = f"validate the load of {whose}, {load.mass_kg:g} kg, first"
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

    def tool_of(self, frame: str, tool: AttachedTool | None) -> AttachedTool | Answer:
        """Return load and TCP of what is moved, in the flange: those of ``frame``, or ``tool`` itself."""
        if tool is not None:
            return tool
        try:
            tcp_in_flange = self._frames.in_flange(frame)
        except (ConfigurationError, UnknownName) as error:
            return _refused(RequestError.ILLEGAL_ARGUMENT, str(error))
        return AttachedTool(self._frames.load_of(frame), tcp_in_flange)

    def validate(self, frame: str, tool: AttachedTool | None, arm: ArmState) -> str | Answer:
        """Return why the load of ``frame``, or of a ``tool``, is not what hangs on the flange; empty when it is."""
        moved = self.tool_of(frame, tool)
        return moved if isinstance(moved, Answer) else self._validation.validate(moved.load, arm)

    def forget(self) -> None:
        """Another application commands; it must validate for itself."""
        self._validation.forget()


def _refused(error: RequestError, reason: str, detail: str = "") -> Answer:
    return Answer(error, Fault(reason, detail))
