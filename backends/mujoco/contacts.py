"""What touches an arm in a scene: where, and with what force, as MuJoCo's last step has it."""

from typing import TYPE_CHECKING

import mujoco
import numpy as np

from hil.values.arm import MAX_CONTACTS, MIN_CONTACT_N, Contact
from hil.values.pose import Pose
from hil.values.robot import JOINT_COUNT

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Contacts:
    """Contacts of the links of one arm, and of the tool on its flange; what leans on its base is not told.

    A face that lies on a face makes several, whose forces add up. Two arms that touch see one contact from both sides,
    each the force on itself, in the axes of its own base.
    """

    def __init__(self, model: "mujoco.MjModel", data: "mujoco.MjData", *, prefix: str, base_in_world: Pose) -> None:
        self._model, self._data = model, data
        links = [model.body(f"{prefix}link_{link}").id for link in range(1, JOINT_COUNT + 1)]
        self._geoms = frozenset(np.flatnonzero(np.isin(model.geom_bodyid, links)).tolist())
        self._base_m = np.array(base_in_world.position_m)
        self._base_axes: NDArray[np.float64] = base_in_world.homogeneous()[:3, :3]
        """Its axes as columns: a row vector in world axes times this is one in base axes."""
        self._wrench = np.zeros(6)

    def now(self) -> tuple[Contact, ...]:
        """Return the strongest ones of the last step, the strongest first."""
        if self._data.ncon == 0:
            return ()
        touching = self._data.contact
        felt: list[tuple[float, Contact]] = []
        for index, (one, other) in enumerate(touching.geom.tolist()):
            if (one in self._geoms) == (other in self._geoms):
                continue
            # In the axes of the contact, whose first points from one geom to the other: the force on the other.
            mujoco.mj_contactForce(self._model, self._data, index, self._wrench)
            strength_n = float(np.linalg.norm(self._wrench[:3]))
            if strength_n < MIN_CONTACT_N:
                continue
            on_other = self._wrench[:3] @ touching.frame[index].reshape(3, 3) @ self._base_axes
            x, y, z = ((touching.pos[index] - self._base_m) @ self._base_axes).tolist()
            fx, fy, fz = (on_other if other in self._geoms else -on_other).tolist()
            felt.append((strength_n, Contact((x, y, z), (fx, fy, fz))))
        felt.sort(key=lambda one: -one[0])
        return tuple([contact for _, contact in felt[:MAX_CONTACTS]])
