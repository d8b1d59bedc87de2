"""Seven simulated drives on a bus: in this process on python-can's virtual bus, or on any bus that was opened."""

import itertools
from collections.abc import Sequence

import can

from backends.can402.objects import SYNC_COB
from backends.can402.simulated.drive import SimulatedDrive
from backends.can402.wire import BUS_OFF, MOST_FRAMES_AT_ONCE, BusFailed, Frame, Wire

_channels = itertools.count()


class SimulatedDrives:
    """Drives by their place, A1 to A7."""

    def __init__(self, nodes: Sequence[int], counts: Sequence[int]) -> None:
        self.drives = [SimulatedDrive(node, counts=at) for node, at in zip(nodes, counts, strict=True)]
        self.bus_off = False
        self._channel = f"fri-hil drives {next(_channels)}"

    def wire(self, *, period_ns: int) -> Wire:
        """Open the virtual bus with these drives behind it; they live on it while somebody looks for their answers."""
        ours = can.Bus(interface="virtual", channel=self._channel)
        theirs = can.Bus(interface="virtual", channel=self._channel)
        return _SimulatedWire(ours, Wire(theirs), self, period_ns)

    def pump(self, wire: Wire, *, period_ns: int, wait_s: float = 0.0, most: int = MOST_FRAMES_AT_ONCE) -> int:
        """Let the drives take what has come on their side of the bus, and answer; return how many frames came.

        The first one is waited for, ``wait_s`` at most.
        """
        for taken in range(most):
            frame = wire.receive(0.0 if taken else wait_s)
            if frame is None:
                return taken
            for drive in self.drives:
                for answer in drive.receive(frame, period_ns=period_ns):
                    wire.send(answer)
        return most

    def passed(self, duration_ns: int) -> list[Frame]:
        """Let time pass for the drives; return the heartbeats that are due."""
        return [frame for drive in self.drives for frame in drive.passed(duration_ns)]


class _SimulatedWire(Wire):
    """Our end of the virtual bus; the drives at the other end answer whenever this end is read."""

    def __init__(self, bus: can.BusABC, theirs: Wire, drives: SimulatedDrives, period_ns: int) -> None:
        super().__init__(bus)
        self._theirs = theirs
        self._drives = drives
        self._period_ns = period_ns

    def send(self, frame: Frame) -> None:
        """Send a frame; a SYNC is a period of the drives' time."""
        if self._drives.bus_off:
            raise BusFailed(BUS_OFF)
        super().send(frame)
        if frame.identifier == SYNC_COB:
            for beat in self._drives.passed(self._period_ns):
                self._theirs.send(beat)

    def receive(self, wait_s: float = 0.0) -> Frame | None:  # noqa: ARG002  # who answers has answered
        """Return the next frame; nobody is worth waiting for."""
        if self._drives.bus_off:
            raise BusFailed(BUS_OFF)
        self._drives.pump(self._theirs, period_ns=self._period_ns)
        return super().receive()

    def check(self) -> None:
        """Raise :class:`BusFailed` for a controller that is off the bus."""
        if self._drives.bus_off:
            raise BusFailed(BUS_OFF)
        super().check()

    def close(self) -> None:
        """Release both ends, after what was sent has reached the drives."""
        if not self._drives.bus_off and self._theirs.bus is not None:
            self._drives.pump(self._theirs, period_ns=self._period_ns)
        self._theirs.close()
        super().close()
