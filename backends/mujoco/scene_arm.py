"""The MuJoCo arm in a scene: with others, and with what can be touched."""

from backends.mujoco.backend import MujocoBackend
from backends.mujoco.scene import prefix_of
from backends.mujoco.torque_sensors import TorqueSensors
from backends.mujoco.world import World
from hil.values.arm import ArmState
from hil.values.backend import BackendRequest


class SceneArm(MujocoBackend):
    """One of the arms of ``world``; its sample counts the cycles of that."""

    def __init__(self, request: BackendRequest, world: World) -> None:
        super(MujocoBackend, self).__init__()
        self.name = request.robot
        self._world = world
        self._sensors = TorqueSensors(seed=request.seed, noise=request.torque_noise)
        self._take_place(world.model, world.data, request.description, prefix=prefix_of(self.name))

    def drive(self, share: float) -> None:
        """Give the motors what they give after ``share`` of the cycle."""
        self._pushes.apply()
        if self._braked:
            return
        if self._told is not None:
            self._motor[:] = self._told
        else:
            self._control(self._from if share == 0.0 else self._between(share))

    def stepped(self) -> None:
        """A cycle of the world is over."""
        self._measured = None
        if self._braked:
            self._brake_torque = self._brakes.torque_nm(self._data)
            return
        self._brake_torque = None
        # An arm that missed its cycle holds what it was told last.
        self._from = self._to
        self._follows_on = self._told is None

    def _open(self, period_ns: int) -> None:
        self._world.enter(self, period_ns=period_ns)
        super()._open(period_ns)

    def _read(self) -> ArmState:
        return super()._read()._replace(sample=self._world.cycles)

    def _step(self) -> None:
        self._world.step(self)

    def _close(self) -> None:
        self._world.leave(self)
