"""The operator's side: what a test does with the pad, the same for a virtual controller and a process."""

from abc import ABC, abstractmethod
from collections.abc import Sequence

from hil.values.arm import DEFAULT_PUSH_S, Push
from hil.values.errors import ConfigurationError, UnknownName
from hil.values.fri import OperationMode
from hil.values.operator import OperatorAction, PadKey, Press, SelectMode, SetInput, SetOverride
from hil.values.robot import JOINT_COUNT, Three
from hil.values.signals import SignalValue


class Operator(ABC):
    """Each call raises :class:`hil.client.pad.PadRefused`, which says why, when it changes nothing."""

    @abstractmethod
    def _do(self, action: OperatorAction) -> None:
        """Do it, or raise."""

    def emergency_stop(self) -> None:
        """Press the emergency stop; it stays down."""
        self._do(Press(PadKey.EMERGENCY_STOP))

    def reset(self) -> None:
        """Pull the emergency stop out, and acknowledge the stop."""
        self._do(Press(PadKey.RESET))

    def mode(self, name: str) -> None:
        """Turn the mode selector to T1, T2 or AUT."""
        valid = OperationMode.__members__
        if name not in valid:
            raise UnknownName("mode", name, valid)
        self._do(SelectMode(OperationMode[name]))

    def enable(self) -> None:
        """Hold the enabling switch, which T1 and T2 need."""
        self._do(Press(PadKey.ENABLE))

    def release(self) -> None:
        """Let the enabling switch go."""
        self._do(Press(PadKey.RELEASE))

    def start(self) -> None:
        """Press the start key: motions run."""
        self._do(Press(PadKey.START))

    def pause(self) -> None:
        """Let the start key go: motions wait."""
        self._do(Press(PadKey.PAUSE))

    def override(self, percent: float) -> None:
        """Set the program override, 0..100 %."""
        self._do(SetOverride(float(percent)))

    def push(
        self,
        force_n: Sequence[float] = (0.0, 0.0, 0.0),
        *,
        moment_nm: Sequence[float] = (0.0, 0.0, 0.0),
        link: int = JOINT_COUNT,
        duration_s: float = DEFAULT_PUSH_S,
    ) -> None:
        """Push the simulated arm at the outer end of a link (7: the flange); N and Nm, axes of the robot base."""
        self._do(Push(link, _three("force", force_n), _three("moment", moment_nm), float(duration_s)))

    def set_input(self, name: str, value: SignalValue) -> None:
        """Set the input ``Group.Name``."""
        self._do(SetInput(name, value))


def _three(what: str, values: Sequence[float]) -> Three:
    if len(values) != 3:
        raise ConfigurationError(f"a {what} of {len(values)} numbers; x, y and z are needed")
    x, y, z = map(float, values)
    return (x, y, z)
