"""The MuJoCo arm: seven torque-driven joints, friction and armature from the facts, under a position controller.

The position controller stands for the one in the real Cabinet, whose gains are not public (facts 4.3): computed torque
with the arm's own mass matrix and bias (gravity, Coriolis), critically damped. Friction is left to the loop, as there.
The commanded acceleration is fed forward: without it the arm runs past the end of a fast motion by 0.2 degrees (iiwa 7,
SmartServo with override 20 and jerk 1500 %), with it by nothing as long as no motor is at its torque limit.

Measured torque is the link side of the gear, actuation minus the torque that accelerates the rotor, with the sign of
the facts (4.4). Not modelled: contact, joint elasticity, gear friction, sensor offset, position noise.
"""

from typing import TYPE_CHECKING

import mujoco
import numpy as np

from backends.base import InProcessBackend
from backends.mujoco.torque_sensors import TorqueSensors
from backends.robots import load_mujoco
from hil.values.arm import ArmState, Capabilities, JointCommand
from hil.values.errors import BackendError
from hil.values.fri import ControlMode, DriveState
from hil.values.robot import JOINT_COUNT, RobotDescription

if TYPE_CHECKING:
    from numpy.typing import NDArray

_STEP_NS = 1_000_000
_ACTIVE = (DriveState.ACTIVE,) * JOINT_COUNT

LOOP_FREQUENCY_RAD_S = 100.0
"""Natural frequency of the position loop. Ours: a tenth of the simulation rate, so the discrete loop is well damped."""


class MujocoBackend(InProcessBackend):
    """One arm in one MuJoCo world; ``seed`` is that of the sensor noise. MuJoCo keeps the motors' torque limits."""

    def __init__(self, description: RobotDescription, *, seed: int = 0) -> None:
        super().__init__()
        self._model = load_mujoco(description.name, shells=False)
        self._model.opt.timestep = _STEP_NS * 1e-9
        self._data = data = mujoco.MjData(self._model)
        # Each of these attributes makes a new view of MuJoCo's memory; one for good is cheaper than one a cycle.
        self._position: NDArray[np.float64] = data.qpos
        self._rate: NDArray[np.float64] = data.qvel
        self._bias: NDArray[np.float64] = data.qfrc_bias
        self._actuation: NDArray[np.float64] = data.qfrc_actuator
        self._applied: NDArray[np.float64] = data.qfrc_applied
        self._rate_change: NDArray[np.float64] = data.qacc
        self._motor: NDArray[np.float64] = data.ctrl
        self._armature: NDArray[np.float64] = self._model.dof_armature.copy()
        self._sensors = TorqueSensors(seed=seed)
        self._steps = 1
        self._time = 0.0
        self._torque = np.zeros(JOINT_COUNT)
        self._acceleration = np.zeros(JOINT_COUNT)
        self._damping = np.zeros(JOINT_COUNT)
        self._from = np.array(description.initial_position_rad)
        self._to = self._from.copy()
        self._velocity = np.zeros(JOINT_COUNT)
        self._feed_forward = np.zeros(JOINT_COUNT)

    @property
    def capabilities(self) -> Capabilities:
        """Seven joints, position control, cycles of whole milliseconds."""
        return Capabilities(
            joint_count=JOINT_COUNT,
            control_modes=frozenset({ControlMode.POSITION}),
            shortest_period_ns=_STEP_NS,
            paces_the_cycle=False,
            moves_real_drives=False,
        )

    def _open(self, period_ns: int) -> None:
        self._steps = period_ns // _STEP_NS
        self._position[:] = self._from
        self._rate[:] = 0.0
        mujoco.mj_forward(self._model, self._data)
        self._motor[:] = self._bias
        mujoco.mj_forward(self._model, self._data)

    def _read(self) -> ArmState:
        actuation = self._actuation
        measured, external = self._sensors.sense(self._armature * self._rate_change - actuation, self._applied)
        return ArmState(
            tuple(self._position.tolist()),
            tuple(self._rate.tolist()),
            tuple(measured.tolist()),
            tuple(external.tolist()),
            tuple((-actuation).tolist()),
            _ACTIVE,
        )

    def _write(self, command: JointCommand) -> None:
        self._from = self._to
        # One array of 21 numbers costs less than three of seven.
        numbers = np.array(command.position_rad + command.velocity_rad_s + command.acceleration_rad_s2)
        self._to, self._velocity, self._feed_forward = numbers[:7], numbers[7:14], numbers[14:]

    def _step(self) -> None:
        model, data = self._model, self._data
        for index in range(self._steps):
            mujoco.mj_step1(model, data)
            self._control(self._from if index == 0 else self._from + (self._to - self._from) * (index / self._steps))
            mujoco.mj_step2(model, data)
        # MuJoCo answers a diverged state by starting over at time zero.
        if data.time < self._time:
            raise BackendError(f"MuJoCo diverged at simulation time {self._time:.3f} s")
        self._time = data.time

    def _control(self, reference: "NDArray[np.float64]") -> None:
        acceleration, damping = self._acceleration, self._damping
        np.subtract(reference, self._position, out=acceleration)
        acceleration *= LOOP_FREQUENCY_RAD_S * LOOP_FREQUENCY_RAD_S
        np.subtract(self._velocity, self._rate, out=damping)
        damping *= 2.0 * LOOP_FREQUENCY_RAD_S
        acceleration += damping
        acceleration += self._feed_forward
        mujoco.mj_mulM(self._model, self._data, self._torque, acceleration)
        np.add(self._torque, self._bias, out=self._motor)
