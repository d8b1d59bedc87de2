"""The MuJoCo arm: seven torque-driven joints, friction and armature from the facts, under a position controller.

The position controller stands for the one in the real Cabinet, whose gains are not public (facts 4.3): computed torque
with the arm's own mass matrix and bias (gravity, Coriolis), critically damped. Friction is left to the loop, as there.
The commanded acceleration is fed forward: without it the arm runs past the end of a fast motion by 0.2 degrees (iiwa 7,
SmartServo with override 20 and jerk 1500 %), with it by nothing as long as no motor is at its torque limit.

Measured torque is the link side of the gear, actuation minus the torque that accelerates the rotor, with the sign of
the facts (4.4). Dropped drives give none, but their brakes do, and sit on the same side of the gear. Commanded torque
is what the position controller asks for; MuJoCo cuts off what a motor cannot give. Not modelled: joint elasticity, gear
friction, sensor offset, position noise; and contact, unless the arm stands in a scene (:mod:`backends.mujoco.scene`).
"""

from struct import Struct
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from backends.base import InProcessBackend
from backends.mujoco.brakes import Brakes
from backends.mujoco.load import hang
from backends.mujoco.pushes import Pushes
from backends.mujoco.torque_sensors import SIGMA_NM, TorqueSensors
from backends.robots import load_mujoco
from hil.values.arm import ArmState, Capabilities, JointCommand, Push, seven
from hil.values.errors import BackendError
from hil.values.load import NO_LOAD, Load
from hil.values.robot import JOINT_COUNT, JOINT_NAMES, RobotDescription, Seven
from hil.values.tuples import new_tuple

if TYPE_CHECKING:
    from numpy.typing import NDArray

STEP_NS = 1_000_000
_CONTACT = int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
_ISLAND = int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
_STILL: Seven = (0.0,) * JOINT_COUNT  # type: ignore[assignment]
_NOT_ESTIMATED = _STILL

LOOP_FREQUENCY_RAD_S = 150.0
"""Natural frequency of the position loop. Ours: 20 N at the flange deflect no robot by 0.2 mm in a regular pose, and at
1 kHz the discrete loop is well damped."""
_SPRING = LOOP_FREQUENCY_RAD_S * LOOP_FREQUENCY_RAD_S
_DAMPER = 2.0 * LOOP_FREQUENCY_RAD_S
_ACCELERATION = Struct(f"{JOINT_COUNT}d")


def capabilities(torque_sigma_nm: Seven = SIGMA_NM) -> Capabilities:
    """Return what such an arm can do, with torque sensors of that noise."""
    return Capabilities(
        joint_count=JOINT_COUNT,
        takes_torque=True,
        torque_sigma_nm=torque_sigma_nm,
        can_be_pushed=True,
        shortest_period_ns=STEP_NS,
        paces_the_cycle=False,
        moves_real_drives=False,
        switches_drives=True,
    )


class MujocoBackend(InProcessBackend):
    """One arm in one MuJoCo world. MuJoCo keeps the motors' torque limits.

    ``seed`` is that of the sensor noise, which can be switched off; ``load`` is what truly hangs on the flange.
    """

    def __init__(
        self, description: RobotDescription, *, seed: int = 0, load: Load = NO_LOAD, torque_noise: bool = True
    ) -> None:
        super().__init__()
        self._sensors = TorqueSensors(seed=seed, noise=torque_noise)
        model = load_mujoco(description.name, shells=False)
        hang(load, model)
        # Nothing here collides, and one arm is one island: to look for both costs a seventh of a step.
        model.opt.disableflags |= _CONTACT | _ISLAND
        model.opt.timestep = STEP_NS * 1e-9
        self._take_place(model, mujoco.MjData(model), description)

    def _take_place(
        self,
        model: "mujoco.MjModel",
        data: "mujoco.MjData",
        description: RobotDescription,
        *,
        prefix: str = "",
        base_in_world: "NDArray[np.float64] | None" = None,
    ) -> None:
        """Be the arm of that ``prefix`` in a world; its base is turned as the rotation says, or not at all."""
        self._model, self._data = model, data
        joint = model.joint(prefix + JOINT_NAMES[0])
        first_dof, first_position = int(joint.dofadr[0]), int(joint.qposadr[0])
        first_motor = int(model.actuator(prefix + JOINT_NAMES[0]).id)
        dofs = slice(first_dof, first_dof + JOINT_COUNT)
        # Each of these attributes makes a new view of MuJoCo's memory; one for good is cheaper than one a cycle.
        self._position: NDArray[np.float64] = data.qpos[first_position : first_position + JOINT_COUNT]
        self._rate: NDArray[np.float64] = data.qvel[dofs]
        self._bias: NDArray[np.float64] = data.qfrc_bias[dofs]
        self._actuation: NDArray[np.float64] = data.qfrc_actuator[dofs]
        self._rate_change: NDArray[np.float64] = data.qacc[dofs]
        self._motor: NDArray[np.float64] = data.ctrl[first_motor : first_motor + JOINT_COUNT]
        self._armature: NDArray[np.float64] = model.dof_armature[dofs].copy()
        self._position[:] = description.initial_position_rad
        self._brakes = Brakes(model, description.limits.torque_nm, first_dof=first_dof)
        self._pushes = Pushes(model, data, prefix=prefix, base_in_world=base_in_world)
        self._whole_torque, self._whole_acceleration = np.zeros(model.nv), np.zeros(model.nv)
        self._torque, self._acceleration = self._whole_torque[dofs], self._whole_acceleration[dofs]
        self._acceleration_memory = self._acceleration.data.cast("B")
        self._braked = False
        self._brake_torque: NDArray[np.float64] | None = None
        self._told: NDArray[np.float64] | None = None
        self._steps = 1
        self._time = 0.0
        self._from = self._to = description.initial_position_rad
        self._follows_on = True
        self._velocity = self._feed_forward = _STILL

    @property
    def capabilities(self) -> Capabilities:
        """Seven joints that take positions or torques, drives that can be dropped, cycles of whole milliseconds."""
        return capabilities(self._sensors.sigma_nm)

    def _open(self, period_ns: int) -> None:
        self._steps = period_ns // STEP_NS
        self._from = self._to = seven(self._position.tolist())
        self._velocity = self._feed_forward = _STILL
        self._follows_on = True
        self._brake_torque = None
        self._rate[:] = 0.0
        mujoco.mj_forward(self._model, self._data)
        self._motor[:] = self._bias
        mujoco.mj_forward(self._model, self._data)

    def _read(self) -> ArmState:
        torque = self._armature * self._rate_change - self._actuation
        if self._brake_torque is not None:
            torque -= self._brake_torque
        measured = self._sensors.sense(torque)
        return new_tuple(
            ArmState,
            (
                tuple(self._position.tolist()),
                tuple(self._rate.tolist()),
                tuple(measured.tolist()),
                _NOT_ESTIMATED,
                tuple((-self._motor).tolist()),
                self._drive_states,
                self._sample,
            ),
        )

    def _write(self, command: JointCommand) -> None:
        if command.torque_nm is not None:
            self._told = np.array(command.torque_nm)
            # A position that comes next need not follow on the last one that was commanded.
            self._follows_on = False
            return
        self._told = None
        position, self._velocity, self._feed_forward = command[:3]
        self._from = self._to if self._follows_on else position
        self._to = position

    def _step(self) -> None:
        model, data = self._model, self._data
        if self._braked:
            for _ in range(self._steps):
                mujoco.mj_step1(model, data)
                self._pushes.apply()
                mujoco.mj_step2(model, data)
            self._brake_torque = self._brakes.torque_nm(data)
        else:
            for index in range(self._steps):
                mujoco.mj_step1(model, data)
                self._pushes.apply()
                if self._told is not None:
                    self._motor[:] = self._told
                else:
                    self._control(self._from if index == 0 else self._between(index / self._steps))
                mujoco.mj_step2(model, data)
            self._follows_on = self._told is None
            self._brake_torque = None
        # MuJoCo answers a diverged state by starting over at time zero.
        if data.time < self._time:
            raise BackendError(f"MuJoCo diverged at simulation time {self._time:.3f} s")
        self._time = data.time

    def _apply_brakes(self) -> None:
        self._brakes.apply()
        self._braked = True
        self._motor[:] = 0.0
        # Whatever is commanded next need not follow on what was commanded before, and that has come to rest.
        self._follows_on = False
        if self._told is not None:
            self._to = seven(self._position.tolist())
        self._from = self._to
        self._velocity = self._feed_forward = _STILL
        self._told = None

    def _push(self, push: Push, steps: int, /) -> None:
        self._pushes.begin(push, steps * self._steps)

    def _release_brakes(self) -> None:
        self._brakes.release()
        self._braked = False

    def _between(self, share: float) -> Seven:
        """Return where this command's way from the one before is after ``share`` of the cycle."""
        return seven([here + (there - here) * share for here, there in zip(self._from, self._to, strict=True)])

    def _control(self, reference: Seven) -> None:
        # Seven numbers one by one cost no more than the six array operations, and commands need not become arrays.
        acceleration = [
            (wanted - here) * _SPRING + (rate - moves) * _DAMPER + planned
            for wanted, here, rate, moves, planned in zip(
                reference,
                self._position.tolist(),
                self._velocity,
                self._rate.tolist(),
                self._feed_forward,
                strict=True,
            )
        ]
        _ACCELERATION.pack_into(self._acceleration_memory, 0, *acceleration)
        mujoco.mj_mulM(self._model, self._data, self._whole_torque, self._whole_acceleration)
        np.add(self._torque, self._bias, out=self._motor)
