"""The MuJoCo arm in a scene: with others, and with what can be touched."""

from typing import Final

from backends.mujoco.backend import MujocoBackend
from backends.mujoco.contacts import Contacts
from backends.mujoco.scene import prefix_of
from backends.mujoco.torque_sensors import TorqueSensors
from backends.mujoco.world import World
from hil.values.arm import ArmState, Contact
from hil.values.backend import BackendRequest
from hil.values.errors import ConfigurationError

DEEPEST_M: Final = 1e-3
"""How far two bodies may overlap when an arm begins."""


class SceneArm(MujocoBackend):
    """One of the arms of ``world``; its sample counts the cycles of that."""

    def __init__(self, request: BackendRequest, world: World) -> None:
        super(MujocoBackend, self).__init__()
        self.name = request.robot
        self._world = world
        self._sensors = TorqueSensors(seed=request.seed, noise=request.torque_noise)
        self._take_place(
            world.model,
            world.data,
            request.description,
            prefix=prefix_of(self.name),
            base_in_world=request.base_in_world.homogeneous()[:3, :3],
        )
        self._touched = Contacts(
            world.model, world.data, prefix=prefix_of(self.name), base_in_world=request.base_in_world
        )

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
        try:
            super()._open(period_ns)
            self._refuse_overlap()
        except BaseException:
            self._world.leave(self)
            raise

    def _refuse_overlap(self) -> None:
        """Nothing may stand where the arm begins: MuJoCo would throw it out."""
        model, prefix = self._model, prefix_of(self.name)
        for contact in self._data.contact[: self._data.ncon]:
            bodies = [model.body(int(model.geom_bodyid[geom])).name for geom in contact.geom]
            if contact.dist < -DEEPEST_M and any(name.startswith(prefix) for name in bodies):
                raise ConfigurationError(
                    f"{bodies[0]} and {bodies[1]} overlap by {-1e3 * contact.dist:.1f} mm where {self.name} begins: "
                    f"move one of them"
                )

    def _read(self) -> ArmState:
        return super()._read()._replace(sample=self._world.cycles)

    def _contacts(self) -> tuple[Contact, ...]:
        return self._touched.now()

    def _step(self) -> None:
        self._world.step(self)

    def _close(self) -> None:
        self._world.leave(self)
