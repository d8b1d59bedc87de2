"""Seven soft joints: each motor follows its set point exactly, and the link swings after it on a damped spring.

The position that is measured is that of the links. Not modelled: mass that one joint feels of another, gravity, torque
(all torques are zero), contact, sensor noise. The brakes sit on the motors: a braked link swings out.
"""

import math

from backends.base import InProcessBackend
from elastic_arm.options import ElasticOptions
from hil.values.arm import ArmState, Capabilities, JointCommand, seven
from hil.values.robot import JOINT_COUNT, Seven

STEP_NS = 1_000_000
CAPABILITIES = Capabilities(
    joint_count=JOINT_COUNT,
    takes_torque=False,
    torque_sigma_nm=None,
    can_be_pushed=False,
    shortest_period_ns=STEP_NS,
    paces_the_cycle=False,
    moves_real_drives=False,
    switches_drives=True,
)
_STILL: Seven = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class ElasticArm(InProcessBackend):
    """The base keeps life cycle, drive states, sample numbers and refusals; here is what is special to this arm."""

    def __init__(self, start_rad: Seven, options: ElasticOptions) -> None:
        super().__init__()
        rate = 2.0 * math.pi * options.frequency_hz
        self._spring = rate * rate
        self._damper = 2.0 * options.damping_ratio * rate
        self._motor_rad = list(start_rad)
        self._link_rad = list(start_rad)
        self._link_rad_s = [0.0] * JOINT_COUNT
        self._told_rad = start_rad
        self._braked = False
        self._steps = 1

    @property
    def capabilities(self) -> Capabilities:
        """Position control, drives that can be dropped, cycles of whole milliseconds."""
        return CAPABILITIES

    def _open(self, period_ns: int) -> None:
        # An arm that is switched on stands still where it is, with no tension in its springs.
        self._steps = period_ns // STEP_NS
        self._motor_rad = list(self._link_rad)
        self._link_rad_s = [0.0] * JOINT_COUNT
        self._told_rad = seven(self._link_rad)

    def _read(self) -> ArmState:
        return ArmState(
            position_rad=seven(self._link_rad),
            velocity_rad_s=seven(self._link_rad_s),
            torque_nm=_STILL,
            external_torque_nm=_STILL,
            commanded_torque_nm=_STILL,
            drive_states=self._drive_states,
            sample=self._sample,
        )

    def _write(self, command: JointCommand) -> None:
        self._told_rad = command.position_rad

    def _step(self) -> None:
        step_s = STEP_NS * 1e-9
        for joint in range(JOINT_COUNT):
            motor, link, rate = self._motor_rad[joint], self._link_rad[joint], self._link_rad_s[joint]
            target = motor if self._braked else self._told_rad[joint]
            motor_rate = (target - motor) / (self._steps * step_s)
            for _ in range(self._steps):
                # Motor and link of one time, else the link runs a step ahead of its motor. First the rate, then the
                # place with the new rate: a swing keeps its energy but for the damper.
                rate += (self._spring * (motor - link) + self._damper * (motor_rate - rate)) * step_s
                link += rate * step_s
                motor += motor_rate * step_s
            self._motor_rad[joint], self._link_rad[joint], self._link_rad_s[joint] = target, link, rate

    def _apply_brakes(self) -> None:
        self._braked = True

    def _release_brakes(self) -> None:
        self._braked = False
