"""Setting many joints of a scene: in one round trip where the simulator is found to take that, else one for each.

One round trip is a line of Lua for the simulator's sandbox. How that is handed over differs between releases, so it is
not trusted but tried on one joint, and read back.
"""

import math
from collections.abc import Sequence
from typing import Final

from tools.view.coppelia.link import CallRefused, Link

_NOBODY: Final = -1
_TRIED_RAD: Final = 0.001
_REFUSED: Final = -1
"""What sim.executeScriptString returns first for an error."""


class Joints:
    """The joints of the scene that is loaded now, by handle; all in kinematic mode."""

    def __init__(self, link: Link, joint: int) -> None:
        """Try on ``joint`` what the simulator takes; it is then somewhere else by a thousandth of a radian at most."""
        self._link = link
        self._sandbox = _NOBODY
        try:
            sandbox = int(link.call("getScript", link.constant("scripttype_sandbox", "scripttype_sandboxscript")))
            wanted = float(link.call("getJointPosition", joint)) + _TRIED_RAD
            self._run(sandbox, [(joint, wanted)])
            read = float(link.call("getJointPosition", joint))
        except (CallRefused, TypeError):
            return
        if math.isclose(read, wanted, abs_tol=_TRIED_RAD / 10.0):
            self._sandbox = sandbox

    @property
    def at_once(self) -> bool:
        """Whether one round trip sets them all."""
        return self._sandbox != _NOBODY

    def set(self, positions_rad: Sequence[tuple[int, float]]) -> None:
        """Set joints by handle."""
        if self.at_once and len(positions_rad) > 1:
            self._run(self._sandbox, positions_rad)
            return
        for joint, position in positions_rad:
            self._link.call("setJointPosition", joint, position)

    def _run(self, sandbox: int, positions_rad: Sequence[tuple[int, float]]) -> None:
        lua = " ".join(f"sim.setJointPosition({joint},{position:.9f})" for joint, position in positions_rad)
        answer = self._link.call("executeScriptString", f"{lua}@lua", sandbox)
        result = answer[0] if isinstance(answer, tuple) else answer
        if result == _REFUSED:
            raise CallRefused(f"CoppeliaSim at {self._link.address} did not set the joints: {answer}")
