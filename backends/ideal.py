"""The ideal arm: follows every set point exactly, one cycle later.

Not modelled: mass, friction, torque (all torques are zero), contact, sensor noise. For tests of what is not the arm.
"""

from backends.base import InProcessBackend
from hil.values.arm import ArmState, Capabilities, JointCommand
from hil.values.fri import ControlMode, DriveState
from hil.values.robot import JOINT_COUNT, RobotDescription, Seven

_ZERO: Seven = (0.0,) * JOINT_COUNT  # type: ignore[assignment]
_ACTIVE = (DriveState.ACTIVE,) * JOINT_COUNT


class IdealBackend(InProcessBackend):
    """Position control only; starts at the description's initial position."""

    def __init__(self, description: RobotDescription) -> None:
        super().__init__()
        self._position = description.initial_position_rad
        self._velocity = _ZERO
        self._next = JointCommand(self._position, _ZERO)

    @property
    def capabilities(self) -> Capabilities:
        """Seven joints, position control, cycles of whole milliseconds."""
        return Capabilities(
            joint_count=JOINT_COUNT,
            control_modes=frozenset({ControlMode.POSITION}),
            shortest_period_ns=1_000_000,
            paces_the_cycle=False,
            moves_real_drives=False,
        )

    def _open(self, _period_ns: int) -> None:
        self._next = JointCommand(self._position, _ZERO)

    def _read(self) -> ArmState:
        return ArmState(self._position, self._velocity, _ZERO, _ZERO, _ZERO, _ACTIVE)

    def _write(self, command: JointCommand) -> None:
        self._next = command

    def _step(self) -> None:
        self._position, self._velocity, _ = self._next
