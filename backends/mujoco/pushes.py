"""What pushes the simulated arm: force and moment at the outer end of a link, for a number of steps."""

from typing import TYPE_CHECKING

import mujoco
import numpy as np

from hil.values.arm import Push
from hil.values.robot import JOINT_COUNT

if TYPE_CHECKING:
    from numpy.typing import NDArray

_FLANGE = "flange"


class Pushes:
    """At most one push at a time; its force goes along with the link it pushes, its direction does not turn."""

    def __init__(self, model: "mujoco.MjModel", data: "mujoco.MjData", *, prefix: str = "") -> None:
        self._data = data
        self._bodies = [model.body(f"{prefix}link_{link}").id for link in range(1, JOINT_COUNT + 1)]
        self._flange = model.site(prefix + _FLANGE).id
        self._body = 0
        self._at: NDArray[np.float64] = np.zeros(3)
        self._push: Push | None = None
        self._steps_left = 0

    def begin(self, push: Push, steps: int) -> None:
        """Push for that many steps, instead of what pushed before."""
        self._data.xfrc_applied[self._body] = 0.0
        self._push = push
        self._steps_left = steps
        self._body = self._bodies[push.link - 1]
        # A view: it shows where the end of the link is now.
        last = push.link == JOINT_COUNT
        self._at = self._data.site_xpos[self._flange] if last else self._data.xpos[self._bodies[push.link]]

    def apply(self) -> None:
        """Put it on the arm for the step that comes; the pose must be that of now."""
        push = self._push
        if push is None:
            return
        if self._steps_left == 0:
            self._data.xfrc_applied[self._body] = 0.0
            self._push = None
            return
        self._steps_left -= 1
        # MuJoCo takes what is applied at the body's centre of mass.
        x, y, z = (self._at - self._data.xipos[self._body]).tolist()
        (fx, fy, fz), (mx, my, mz) = push.force_n, push.moment_nm
        self._data.xfrc_applied[self._body] = (
            *(fx, fy, fz),
            *(mx + y * fz - z * fy, my + z * fx - x * fz, mz + x * fy - y * fx),
        )
