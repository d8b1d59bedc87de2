"""Override and pause: the arm stays on its path, keeps its limits, and goes on exactly where it was going."""

import itertools
import math
import random

import numpy as np
import pytest

from backends.robots import load_description
from hil.core.motion.executive import MotionExecutive, Phase
from hil.core.motion.point_to_point import PointToPoint
from hil.core.motion.set_point import STILL, SetPoint
from hil.core.motion.smart_servo import SmartServo
from hil.values.motion import Fault, MotionParameters
from hil.values.robot import Seven
from hil.values.servo import Vector
from tests.support.interpolation import basis_of
from tests.support.servo_virtual import offset

ROBOT = load_description("lbr-iiwa-7-r800")
START = ROBOT.initial_position_rad
LIMITS = ROBOT.limits
MS = 1_000_000


class Rig:
    """An executive with one application's motion, cycle by cycle."""

    def __init__(self, goal: Vector, *, kind: type[PointToPoint] | type[SmartServo] = PointToPoint) -> None:
        self.motion = MotionExecutive(START, limits=LIMITS, cycle_s=1e-3)
        self.motion.applications.add(1, kind(MotionParameters(), basis=basis_of(), destination=goal))
        self.now_ns = 0
        self.path: list[SetPoint] = []

    def run(self, cycles: int) -> None:
        for _ in range(cycles):
            self.now_ns += MS
            proposed = self.motion.propose(
                measured_rad=self.motion.set_point.position_rad, now_ns=self.now_ns, started_ns=self.now_ns
            )
            assert not isinstance(proposed, Fault), proposed
            self.motion.commit(proposed, now_ns=self.now_ns)
            self.path.append(proposed)

    def phase(self) -> Phase:
        return self.motion.phase

    def pause(self) -> None:
        self.motion.pause(now_ns=self.now_ns)

    def resume(self) -> None:
        self.motion.resume(now_ns=self.now_ns)

    def positions(self) -> "np.ndarray[tuple[int, int], np.dtype[np.float64]]":
        return np.array([point.position_rad for point in self.path])


GOAL: Seven = offset(START, A1=0.8, A2=-0.3, A4=0.5, A6=0.4)  # type: ignore[assignment]


def off_the_line(rig: Rig) -> float:
    """Largest distance of the path from the straight line in axis space, rad."""
    line = np.array(GOAL) - np.array(START)
    line /= np.linalg.norm(line)
    way = rig.positions() - np.array(START)
    return float(np.abs(way - np.outer(way @ line, line)).max())


def assert_limits(rig: Rig) -> None:
    before = SetPoint(START, STILL)
    for point in rig.path:
        for axis in range(7):
            assert abs(point.velocity_rad_s[axis]) <= LIMITS.velocity_rad_s[axis] * (1 + 1e-9)
            step = point.position_rad[axis] - before.position_rad[axis]
            assert abs(step) <= LIMITS.velocity_rad_s[axis] * 1e-3 * (1 + 1e-9)
            change = (point.velocity_rad_s[axis] - before.velocity_rad_s[axis]) / 1e-3
            assert abs(change) <= 1.2 * LIMITS.acceleration_rad_s2[axis], (axis, change)
        before = point


def moved(rig: Rig) -> bool:
    return rig.path[-1].position_rad != rig.path[-2].position_rad


@pytest.mark.parametrize("seed", range(12))
def test_pauses_leave_a_ptp_on_its_line_and_it_arrives_exactly(seed: int) -> None:
    rng = random.Random(seed)
    rig = Rig(GOAL)
    rig.run(rng.randint(1, 900))
    for _ in range(rng.randint(1, 5)):
        rig.pause()
        rig.run(rng.randint(1, 700))
        rig.resume()
        rig.run(rng.randint(1, 400))
    rig.resume()
    rig.run(4000)
    assert rig.path[-1] == SetPoint(GOAL, STILL)
    assert rig.phase() is Phase.HOLDING
    assert off_the_line(rig) < 1e-7
    assert_limits(rig)


def test_a_pause_stops_within_the_time_the_drives_need_and_the_arm_stays() -> None:
    rig = Rig(GOAL)
    rig.run(500)
    speed = max(
        abs(velocity) / rated
        for velocity, rated in zip(rig.path[-1].velocity_rad_s, LIMITS.acceleration_rad_s2, strict=True)
    )
    ramp = max(a / j for a, j in zip(LIMITS.acceleration_rad_s2, LIMITS.jerk_rad_s3, strict=True))
    assert speed > 0.1
    rig.pause()
    needed = 0
    while not rig.motion.stands:
        rig.run(1)
        needed += 1
        assert needed < 2000
    # Twice: what is left of the tempo is taken off with a square root at the end.
    assert needed * 1e-3 <= 2.0 * (speed + ramp)
    rig.run(500)
    assert not moved(rig)
    assert rig.path[-1].velocity_rad_s == STILL
    assert rig.phase() is Phase.APPLICATION


@pytest.mark.parametrize("percent", [1, 7.3, 33, 50, 99.9])
def test_an_override_slows_a_ptp_down_on_the_same_line(percent: float) -> None:
    full = Rig(GOAL)
    full.run(3000)
    needed = next(cycle for cycle, point in enumerate(full.path) if point.position_rad == GOAL)
    slow = Rig(GOAL)
    slow.motion.set_override(percent / 100)
    slow.run(math.ceil((needed + 3) * 100 / percent))
    arrived = next(cycle for cycle, point in enumerate(slow.path) if point.position_rad == GOAL)
    assert arrived == pytest.approx(needed * 100 / percent, abs=300 / percent)
    fastest = max(abs(point.velocity_rad_s[0]) for point in full.path)
    assert max(abs(point.velocity_rad_s[0]) for point in slow.path) == pytest.approx(fastest * percent / 100, rel=0.01)
    assert off_the_line(slow) < 1e-7
    assert slow.motion.phase is Phase.HOLDING


def test_an_override_of_nothing_stands_still_and_may_be_raised_again() -> None:
    rig = Rig(GOAL)
    rig.motion.set_override(0.0)
    rig.run(500)
    assert rig.path[-1].position_rad == START
    rig.motion.set_override(1.0)
    rig.run(400)
    rig.motion.set_override(0.0)
    rig.run(700)
    assert not moved(rig)
    rig.motion.set_override(0.4)
    rig.run(6000)
    assert rig.path[-1].position_rad == GOAL
    assert_limits(rig)


@pytest.mark.parametrize("seed", range(12))
def test_smart_servo_keeps_its_limits_through_pauses_overrides_and_new_destinations(seed: int) -> None:
    rng = random.Random(seed)
    rig = Rig(GOAL, kind=SmartServo)
    goal: Seven = START
    rig.run(2)
    for _ in range(25):
        active = rig.motion.applications.active
        assert active is not None
        match rng.randrange(4):
            case 0:
                rig.pause()
            case 1:
                rig.resume()
            case 2:
                rig.motion.set_override(rng.choice((0.0, 0.05, 0.3, 0.77, 1.0)))
            case _:
                goal = tuple(value + rng.uniform(-0.4, 0.4) for value in START)  # type: ignore[assignment]
                fault = active.motion.set_destination(goal, None, measured_rad=START, arrived_ns=rig.now_ns)
                assert fault is None
        rig.run(rng.randint(1, 120))
    rig.resume()
    rig.motion.set_override(1.0)
    rig.run(9000)
    assert rig.path[-1].position_rad in {goal, GOAL}
    for here, there in itertools.pairwise(rig.path):
        for axis in range(7):
            step = there.position_rad[axis] - here.position_rad[axis]
            assert abs(step) <= LIMITS.velocity_rad_s[axis] * 1e-3 * (1 + 1e-9)
            assert LIMITS.position_min_rad[axis] <= there.position_rad[axis] <= LIMITS.position_max_rad[axis]


def test_timeouts_do_not_run_while_a_motion_is_paused() -> None:
    rig = Rig(START, kind=SmartServo)
    parameters = MotionParameters(timeout_after_goal_s=0.2)
    rig.motion.applications.fail(Fault("replaced"), now_ns=0)
    rig.motion.applications.add(2, SmartServo(parameters, basis=basis_of(), destination=None))
    rig.run(150)
    rig.pause()
    rig.run(1000)
    rig.resume()
    rig.run(20)
    assert rig.phase() is Phase.APPLICATION
    rig.run(60)
    assert rig.phase() is Phase.HOLDING


def test_what_waits_does_not_begin_while_paused() -> None:
    rig = Rig(GOAL)
    rig.pause()
    rig.run(100)
    assert rig.phase() is Phase.HOLDING
    assert rig.motion.applications.started == 0
    rig.resume()
    rig.run(4000)
    assert rig.path[-1].position_rad == GOAL
