"""The backend ``can402`` on the bench: seven simulated drives at the other end of python-can's virtual bus."""

from backends.can402.backend import Can402Backend
from backends.can402.bus_load import BusLoad
from backends.can402.options import Can402Options
from backends.can402.scaling import AxisScale
from backends.can402.simulated import DriveFault, SimulatedDrives
from backends.rig import Rig
from hil.values.arm import Backend, seven
from hil.values.robot import RobotDescription, Seven

_LOST = 3
"""Place of the drive that is lost: that of A4."""


class SimulatedDrivesRig(Rig):
    """Time passes for the drives with each SYNC."""

    has_peer = True

    def __init__(self, description: RobotDescription, options: Can402Options | None = None) -> None:
        self._options = options or Can402Options(simulated=True)
        self._backend = Can402Backend(self._options, start_rad=description.initial_position_rad)

    @property
    def backend(self) -> Backend:
        """The backend itself."""
        return self._backend

    @property
    def drives(self) -> SimulatedDrives:
        """The drives, to be made to fail; there once the backend was opened."""
        if self._backend.simulated is None:
            raise ValueError("the drives are there once the backend was opened")
        return self._backend.simulated

    @property
    def load(self) -> BusLoad | None:
        """How full a cycle would make the bus; known once the backend was opened."""
        return self._backend.load

    def true_position_rad(self) -> Seven:
        """Where the drives count themselves to be."""
        scales = map(AxisScale, self._options.axis)
        return seven(
            [scale.position_rad(drive.counts) for scale, drive in zip(scales, self.drives.drives, strict=True)]
        )

    def lose_peer(self) -> None:
        """The cable of one drive breaks."""
        self.drives.drives[_LOST].faults.add(DriveFault.LOST)

    def restore_peer(self) -> None:
        """The drive is on the bus again."""
        self.drives.drives[_LOST].faults.discard(DriveFault.LOST)
