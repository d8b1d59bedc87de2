"""A servo application that carries parts from one point to another: ``python -m cell.carry``.

When the operator stops the arm it waits until he lets motions run again, and goes on with the part it was carrying.
"""

import sys
import time
from dataclasses import dataclass

from hil.client.servo import PTP, CommandInvalidException, ServoClient

PICK = (0.3, 0.6, 0.0, 0.9, 0.0, 1.3, 0.0)
PLACE = (-0.3, 0.6, 0.0, 0.9, 0.0, 1.3, 0.0)
"""Axis positions in rad."""
LOOK_S = 0.05
"""Between two looks at what the operator does."""


class OperatorAway(Exception):
    """The operator stopped the arm and did not let it go on in time."""


@dataclass
class Report:
    """What became of a run."""

    carried: int = 0
    interruptions: int = 0


class Carrier:
    """Carries with the arm of ``controller``; waits ``patience_s`` for the operator."""

    def __init__(
        self,
        controller: str,
        *,
        pick: tuple[float, ...] = PICK,
        place: tuple[float, ...] = PLACE,
        speed: float = 0.5,
        patience_s: float = 30.0,
    ) -> None:
        self.report = Report()
        self._controller = controller
        self._points = pick, place
        self._speed = speed
        self._patience_s = patience_s

    def carry(self, parts: int) -> Report:
        """Carry so many parts; raise :class:`OperatorAway`, or what the client raises when there is no arm to have."""
        with ServoClient(self._controller, name="carrier") as robot:
            for _ in range(parts):
                for point in self._points:
                    self._go(robot, point)
                self.report.carried += 1
        return self.report

    def _go(self, robot: ServoClient, point: tuple[float, ...]) -> None:
        while True:
            try:
                robot.move(PTP(point).set_joint_velocity_rel(self._speed))
            except CommandInvalidException:
                if not robot.operator.reason:
                    raise
                self.report.interruptions += 1
                self._wait_for_operator(robot)
            else:
                return

    def _wait_for_operator(self, robot: ServoClient) -> None:
        gives_up_at = time.monotonic() + self._patience_s
        while reason := robot.read_state().operator.reason:
            if time.monotonic() >= gives_up_at:
                raise OperatorAway(reason)
            time.sleep(LOOK_S)


if __name__ == "__main__":
    print(Carrier("127.0.0.1:30300").carry(int(sys.argv[1]) if len(sys.argv) > 1 else 3))
