"""The arm under the controller, in virtual time."""

import math

import pytest

from hil.client.servo import PTP, CommandInvalidException, ServoClient
from hil.testkit import VirtualController

pytestmark = pytest.mark.hil(backend="elastic", fri=None)
NEAR = (0.1, math.radians(30.0), 0.0, math.radians(45.0), 0.0, math.radians(90.0), 0.0)


def swing_rad(controller: VirtualController) -> float:
    """Go to NEAR, and return how far A1 is off in the half second after the motion has ended."""
    with ServoClient("192.168.0.10:30300") as robot:
        robot.move(PTP(NEAR))
    farthest = 0.0
    for _ in range(500):
        controller.run(0.001)
        farthest = max(farthest, abs(controller.measured_position_rad[0] - NEAR[0]))
    return farthest


@pytest.mark.hil("station.toml", options={"frequency_hz": 3, "damping_ratio": 0.1})
def test_soft_joints_swing_after_the_motion(hil_controller: VirtualController) -> None:
    assert swing_rad(hil_controller) > 2e-3


@pytest.mark.hil(options={"frequency_hz": 40})
def test_stiff_ones_do_not(hil_controller: VirtualController) -> None:
    assert swing_rad(hil_controller) < 1e-4


@pytest.mark.hil(options={"frequency_hz": 1, "damping_ratio": 0.05})
def test_joints_too_soft_for_their_motion_are_stopped_by_the_controller(hil_controller: VirtualController) -> None:
    far = (1.0, *NEAR[1:])
    with ServoClient("192.168.0.10:30300") as robot, pytest.raises(CommandInvalidException):
        robot.move(PTP(far))
    assert hil_controller.last_stop is not None
    assert "A1" in hil_controller.last_stop.reason


def test_it_moves_and_comes_to_rest(hil_controller: VirtualController) -> None:
    with ServoClient("192.168.0.10:30300") as robot:
        robot.move(PTP(NEAR))
    hil_controller.run(1.0)
    assert hil_controller.measured_position_rad == pytest.approx(NEAR, abs=1e-4)
    assert hil_controller.last_stop is None
