"""A stop that brakes and then drops the drives waits for the arm, not only for what it is told."""

from typing import Any

import pytest

from hil.core.safety.drives import LONGEST_COASTING_NS, STANDSTILL_RAD_S, Drives
from hil.values.operator import StopCategory

MS = 1_000_000
BRAKE = StopCategory.BRAKE_AND_DROP


class Switches:
    """A robot side of which only the drives count."""

    def __init__(self) -> None:
        self.capabilities = type("Capabilities", (), {"switches_drives": True})()
        self.told: list[bool] = []

    def switch_drives(self, *, on: bool) -> None:
        self.told.append(on)


class Arm:
    """A measured state of which only the velocity counts."""

    def __init__(self, fastest_rad_s: float) -> None:
        self.velocity_rad_s = (0.0, -fastest_rad_s, 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.fixture
def switches() -> Switches:
    return Switches()


@pytest.fixture
def drives(switches: Switches) -> Any:
    made: Any = Drives(switches)  # type: ignore[arg-type]
    return made


def test_brakes_do_not_grip_an_arm_that_still_moves(drives: Any, switches: Switches) -> None:
    for cycle in range(20):
        drives.follow(BRAKE, stands=True, arm=Arm(0.3), now_ns=cycle * MS)
    assert not drives.dropped
    drives.follow(BRAKE, stands=True, arm=Arm(STANDSTILL_RAD_S), now_ns=20 * MS)
    assert (drives.dropped, switches.told) == (True, [False])


def test_nobody_waits_for_ever(drives: Any) -> None:
    drives.follow(BRAKE, stands=True, arm=Arm(0.3), now_ns=0)
    drives.follow(BRAKE, stands=True, arm=Arm(0.3), now_ns=LONGEST_COASTING_NS - 1)
    assert not drives.dropped
    drives.follow(BRAKE, stands=True, arm=Arm(0.3), now_ns=LONGEST_COASTING_NS)
    assert drives.dropped


def test_waiting_begins_anew_with_each_stop(drives: Any) -> None:
    drives.follow(BRAKE, stands=True, arm=Arm(0.3), now_ns=0)
    drives.follow(None, stands=True, arm=Arm(0.3), now_ns=MS)
    drives.follow(BRAKE, stands=True, arm=Arm(0.3), now_ns=LONGEST_COASTING_NS)
    drives.follow(BRAKE, stands=False, arm=Arm(0.3), now_ns=2 * LONGEST_COASTING_NS - 1)
    drives.follow(BRAKE, stands=True, arm=Arm(0.3), now_ns=2 * LONGEST_COASTING_NS)
    assert not drives.dropped


def test_a_drop_waits_for_nothing(drives: Any) -> None:
    drives.follow(StopCategory.DROP, stands=False, arm=Arm(2.0), now_ns=0)
    assert drives.dropped
