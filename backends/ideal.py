"""The ideal arm: follows every set point exactly, one cycle later; its brakes stop it within one cycle.

Not modelled: mass, friction, torque (all torques are zero), contact, sensor noise. For tests of what is not the arm.
"""

from backends.base import InProcessBackend
from hil.values.arm import ArmState, Capabilities, JointCommand
from hil.values.robot import JOINT_COUNT, RobotDescription, Seven
from hil.values.tuples import new_tuple

_ZERO: Seven = (0.0,) * JOINT_COUNT  # type: ignore[assignment]
CAPABILITIES = Capabilities(
    joint_count=JOINT_COUNT,
    takes_torque=False,
    torque_sigma_nm=None,
    can_be_pushed=False,
    shortest_period_ns=1_000_000,
    paces_the_cycle=False,
    moves_real_drives=False,
    switches_drives=True,
)


class IdealBackend(InProcessBackend):
    """Position control only; starts at the description's initial position."""

    def __init__(self, description: RobotDescription) -> None:
        super().__init__()
        self._position = description.initial_position_rad
        self._velocity = _ZERO
        self._next = JointCommand(self._position, _ZERO)
        self._braked = False

    @property
    def capabilities(self) -> Capabilities:
        """Seven joints, position control, drives that can be dropped, cycles of whole milliseconds."""
        return CAPABILITIES

    def _open(self, _period_ns: int) -> None:
        self._velocity = _ZERO
        self._next = JointCommand(self._position, _ZERO)

    def _read(self) -> ArmState:
        return new_tuple(
            ArmState, (self._position, self._velocity, _ZERO, _ZERO, _ZERO, self._drive_states, self._sample)
        )

    def _write(self, command: JointCommand) -> None:
        self._next = command

    def _step(self) -> None:
        if self._braked:
            self._velocity = _ZERO
        else:
            self._position, self._velocity = self._next.position_rad, self._next.velocity_rad_s

    def _apply_brakes(self) -> None:
        self._braked = True
        self._next = JointCommand(self._next.position_rad, _ZERO)

    def _release_brakes(self) -> None:
        self._braked = False
