"""Destinations that are poses, over the servo link: reached in the nearest branch, or refused; in virtual time."""

import itertools
import math
import struct

import numpy as np
import pinocchio
import pytest

from backends.robots import FLANGE, load_description, load_pinocchio
from hil.core.kinematics.answers import NoPosition
from hil.core.kinematics.redundancy import largest_change_rad
from hil.core.kinematics.srs import SrsKinematics
from hil.core.motion.executive import Phase
from hil.values.arm import seven
from hil.values.motion import ErrorReason, Fault, MotionEnd, MotionKind, MotionParameters, MotionPhase
from hil.values.outcomes import Outcome
from hil.values.pose import Pose
from hil.values.robot import Seven
from hil.values.servo import Command, RequestError, SetDestination, StartMotion
from tests.support.interpolation import MOTIONS, at, basis_of
from tests.support.servo_virtual import Application, ServoBench, offset
from tests.unit.robots_support import NAMES

ROBOT = "lbr-iiwa-14-r820"
REACHED = 1e-6
"""Metres, and rad."""
LIMIT_REASON = {
    MotionKind.PTP: ErrorReason.POSITIONAL_LIMITS,
    MotionKind.SMART_SERVO: ErrorReason.POSITIONAL_LIMITS,
    MotionKind.DIRECT_SERVO: ErrorReason.DIRECT_SERVO_LIMIT,
}
SERVO_KINDS = [MotionKind.SMART_SERVO, MotionKind.DIRECT_SERVO]
FAR = Pose(2.5, 0.0, 0.5)
QUICK = MotionParameters(joint_jerk_percent=500.0, acceleration_override=20.0)
robots = pytest.mark.parametrize("robot", NAMES)


class Flange:
    """Where the flange of a robot is, by Pinocchio."""

    def __init__(self, robot: str) -> None:
        self.model = load_pinocchio(robot)
        self.closed = SrsKinematics(self.model, load_description(robot).limits)
        self._data = self.model.createData()

    def at(self, position_rad: tuple[float, ...]) -> Pose:
        pinocchio.framesForwardKinematics(self.model, self._data, np.array(position_rad))
        return Pose.from_homogeneous(np.array(self._data.oMf[self.model.getFrameId(FLANGE)].homogeneous))


def joined(robot: str = ROBOT) -> tuple[Application, Flange, Seven]:
    """Return an application with the arm, that arm's flange, and the axis positions it begins at."""
    application = Application(ServoBench(robot=robot))
    application.join()
    return application, Flange(robot), application.bench.description.initial_position_rad


def set_point(application: Application) -> Seven:
    return application.bench.controller.motion.set_point.position_rad


def moved_to(application: Application, position_rad: tuple[float, ...]) -> None:
    """Take the arm somewhere by axis positions."""
    over = len(application.ends) + 1
    application.start(MotionKind.PTP, position_rad)
    application.run_until(lambda: len(application.ends) == over)
    assert application.ends[-1].end is MotionEnd.FINISHED, application.ends[-1]


def until_at_goal(application: Application, motion: int) -> None:
    """Let time pass until the last destination of a motion is where the set point is."""
    application.run_until(lambda: set_point(application) == application.motion(motion).destination)


def assert_at(flange: Flange, position_rad: tuple[float, ...], pose: Pose) -> None:
    there = flange.at(position_rad)
    assert there.distance_m(pose) < REACHED
    assert there.angle_rad(pose) < REACHED


def assert_no_jump(application: Application) -> None:
    """Between two cycles no set point moves farther than its axis may."""
    limits = application.bench.description.limits.velocity_rad_s
    for axis in range(7):
        for here, there in itertools.pairwise(application.bench.commanded(axis)):
            assert abs(there - here) <= limits[axis] * 1e-3 * (1 + 1e-6), (axis, here, there)


def beside(pose: Pose, *, mm: tuple[float, float, float], abc_deg: tuple[float, float, float]) -> Pose:
    """Return a pose so far from another, in that one's axes."""
    x, y, z = mm
    return pose @ Pose.from_abc_deg((1e-3 * x, 1e-3 * y, 1e-3 * z), *abc_deg)


# Reached


@robots
@pytest.mark.parametrize("kind", list(MotionKind))
def test_the_first_destination_of_a_motion_may_be_a_pose(robot: str, kind: MotionKind) -> None:
    application, flange, start = joined(robot)
    pose = beside(flange.at(start), mm=(12.0, -15.0, 8.0), abc_deg=(1.5, -1.0, 2.0))
    motion = application.start(kind, pose)
    application.run_until(lambda: bool(application.goals))
    assert application.goals[0].motion == motion
    assert_at(flange, set_point(application), pose)
    snapshot = application.states[-1].snapshot
    assert snapshot.commanded_position == set_point(application)
    assert_at(flange, snapshot.measured_position, snapshot.flange_in_base)
    assert_no_jump(application)


@robots
@pytest.mark.parametrize("kind", SERVO_KINDS)
def test_a_running_motion_goes_from_pose_to_pose_in_its_branch_with_its_e1(robot: str, kind: MotionKind) -> None:
    """Also off the E1 the arm began with, and with every bit of Status both ways."""
    random = np.random.default_rng(17)
    for signs in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
        application, flange, _ = joined(robot)
        elbow, wrist = signs
        # The wrist centre far from the axis of A1: beside it another E1 would be nearer.
        present = (0.0, -0.5 * elbow, 0.3, 1.2 * elbow, 0.2, 1.0 * wrist, 0.1)
        moved_to(application, present)
        status = flange.closed.status_of(seven(present))
        motion = application.start(kind, None, QUICK if kind is MotionKind.SMART_SERVO else None)
        pose = flange.at(present)
        for _ in range(4):
            pose = beside(pose, mm=tuple(random.uniform(-8, 8, 3)), abc_deg=tuple(random.uniform(-1, 1, 3)))
            before = set_point(application)
            done = application.set_destination(motion, pose)
            assert done.error is RequestError.NONE, done
            until_at_goal(application, motion)
            assert_at(flange, set_point(application), pose)
            assert set_point(application)[2] == present[2]
            assert flange.closed.status_of(set_point(application)) == status
            assert largest_change_rad(set_point(application), before) < 0.1
        assert_no_jump(application)


def test_a_pose_sent_while_the_arm_moves_is_judged_from_where_it_is_then() -> None:
    application, flange, start = joined()
    motion = application.start(MotionKind.SMART_SERVO, offset(start, A3=0.6))
    application.run_until(lambda: set_point(application)[2] > 0.3)
    here = set_point(application)
    assert here[2] < 0.4
    pose = beside(flange.at(here), mm=(20.0, 0.0, 0.0), abc_deg=(0.0, 0.0, 0.0))
    application.set_destination(motion, pose)
    assert application.motion(motion).destination[2] == pytest.approx(here[2], abs=1e-2)
    until_at_goal(application, motion)
    assert_at(flange, set_point(application), pose)
    assert_no_jump(application)


@pytest.mark.parametrize("kind", list(MotionKind))
def test_a_pose_the_arm_is_at_moves_nothing(kind: MotionKind) -> None:
    application, flange, start = joined()
    application.start(kind, flange.closed.forward(start))
    application.run_until(lambda: bool(application.goals))
    assert {position for axis in range(7) for position in application.bench.commanded(axis)} <= set(start)


def test_another_e1_is_taken_where_the_present_one_leads_out_of_an_axis() -> None:
    """The pose is reached by what is nearest then, and by no jump."""
    application, flange, start = joined()
    pose = flange.at(offset(start, A1=0.4, A3=0.9, A5=-0.7))
    kept = flange.closed.inverse(pose, start[2], flange.closed.status_of(start), near_rad=start)
    high = application.bench.description.limits.position_max_rad[4]
    assert not isinstance(kept, NoPosition)
    for share in np.linspace(0.0, 1.0, 12):
        a7 = high * share
        target = pose @ Pose.from_abc_rad((0.0, 0.0, 0.0), a7, 0.0, 0.0)
        answer = flange.closed.inverse(target, start[2], flange.closed.status_of(start), near_rad=start)
        if isinstance(answer, NoPosition):
            break
    else:
        pytest.fail("E1 can be kept everywhere: the test proves nothing")
    application.start(MotionKind.PTP, target)
    application.run_until(lambda: bool(application.ends))
    assert application.ends[0].end is MotionEnd.FINISHED, application.ends[0]
    assert_at(flange, set_point(application), target)
    assert set_point(application)[2] != start[2]
    assert_no_jump(application)


@pytest.mark.parametrize(
    "axes",
    [{"A6": 0.0}, {"A4": 0.0}, {"A2": 0.0, "A3": math.pi / 2}, {"A2": 0.0, "A4": 0.0, "A6": 0.0}],
    ids=str,
)
@pytest.mark.parametrize("kind", [MotionKind.PTP, MotionKind.SMART_SERVO])
def test_a_pose_in_a_singularity_is_reached(kind: MotionKind, axes: dict[str, float]) -> None:
    """The axes that turn about one line there share it as they do now, so nothing is left open."""
    application, flange, start = joined()
    there = tuple(axes.get(f"A{axis}", value) for axis, value in enumerate(offset(start, A1=0.2, A5=0.1), start=1))
    assert flange.closed.singularities_of(seven(there), tolerance_rad=1e-9)
    pose = flange.at(there)
    application.start(kind, pose)
    application.run_until(lambda: bool(application.goals) or bool(application.ends))
    assert application.goals, application.ends
    assert_at(flange, set_point(application), pose)
    assert_no_jump(application)


@pytest.mark.parametrize("axes", [{}, {"A6": 0.0}, {"A4": 0.0}], ids=["candle", "A6 = 0", "A4 = 0"])
def test_from_a_singularity_a_pose_the_arm_can_reach_is_reached(axes: dict[str, float]) -> None:
    application, flange, start = joined()
    singular = tuple(axes.get(f"A{axis}", value) for axis, value in enumerate(start, start=1)) if axes else (0.0,) * 7
    moved_to(application, singular)
    pose = flange.at(offset(singular, A1=0.1, A2=0.25, A4=0.4, A6=0.5))
    application.start(MotionKind.PTP, pose)
    application.run_until(lambda: len(application.ends) == 2)
    assert application.ends[1].end is MotionEnd.FINISHED, application.ends[1]
    assert_at(flange, set_point(application), pose)
    assert_no_jump(application)


# While it waits


@pytest.mark.parametrize("kind", SERVO_KINDS)
def test_a_pose_for_a_queued_motion_is_where_it_will_go(kind: MotionKind) -> None:
    application, flange, start = joined()
    one = application.start(MotionKind.SMART_SERVO)
    application.start(MotionKind.SMART_SERVO)
    three = application.start(kind)
    pose = beside(flange.at(start), mm=(10.0, 10.0, -10.0), abc_deg=(0.0, 1.0, 0.0))
    assert application.set_destination(three, pose).error is RequestError.NONE
    assert application.motion(three).phase is MotionPhase.QUEUED
    application.run(0.1)
    assert set_point(application) == start
    application.stop(one)
    application.stop(one + 1)
    application.run_until(lambda: bool(application.goals) and application.goals[-1].motion == three)
    assert_at(flange, set_point(application), pose)


@pytest.mark.parametrize("kind", list(MotionKind))
def test_the_pose_a_queued_motion_was_made_with_is_judged_when_it_begins(kind: MotionKind) -> None:
    """The motion before it changes E1: the second keeps the new one."""
    application, flange, start = joined()
    away = offset(start, A1=0.1, A3=0.4)
    application.start(MotionKind.PTP, away)
    pose = beside(flange.at(away), mm=(0.0, 5.0, 0.0), abc_deg=(0.0, 0.0, 1.0))
    two = application.start(kind, pose)
    assert application.motion(two).destination == ()
    application.run_until(lambda: bool(application.goals) and application.goals[-1].motion == two)
    assert_at(flange, set_point(application), pose)
    assert set_point(application)[2] == away[2]
    assert_no_jump(application)


@pytest.mark.parametrize("kind", SERVO_KINDS)
def test_a_pose_out_of_reach_for_a_queued_motion_ends_that_one_and_the_arm_goes_on(kind: MotionKind) -> None:
    application, _, start = joined()
    goal = offset(start, A1=0.5)
    one = application.start(MotionKind.SMART_SERVO, goal)
    two = application.start(kind)
    application.run(0.2)
    done = application.set_destination(two, FAR)
    assert (done.error, done.reason) == (RequestError.COMMAND_INVALID, LIMIT_REASON[kind])
    assert [(end.motion, end.reason) for end in application.ends] == [(two, LIMIT_REASON[kind])]
    assert list(application.bench.controller.stops) == []
    until_at_goal(application, one)
    assert set_point(application) == goal


# Refused


def out_of_limits(flange: Flange) -> Pose:
    """A pose whose wrist centre only an A4 beyond its range reaches, whatever the other axes do."""
    return flange.closed.forward((0.1, 0.5, 0.2, flange.closed.limits.position_max_rad[3] + 0.1, 0.3, 0.7, 0.2))


@robots
@pytest.mark.parametrize("where", ["far", "outside the limits"])
@pytest.mark.parametrize("kind", list(MotionKind))
def test_a_motion_made_for_a_pose_it_cannot_reach_ends_as_it_begins(robot: str, kind: MotionKind, where: str) -> None:
    application, flange, start = joined(robot)
    pose, parameters = FAR if where == "far" else out_of_limits(flange), MotionParameters()
    application.ask(
        lambda number: StartMotion(number, kind, parameters, None, pose),
        lambda number: StartMotion(number, MotionKind.SMART_SERVO, parameters, None),
    )
    application.run(0.02)
    first, second = application.ends
    assert (first.end, first.reason) == (MotionEnd.FAILED, LIMIT_REASON[kind])
    if where == "far":
        assert first.detail.startswith("unreachable: the wrist centre is ")
        assert first.detail.endswith(" mm beyond the stretched arm")
    else:
        assert first.detail.startswith("outside its limits: A4 at ")
        assert "; valid: -" in first.detail
    assert second.reason == f"a motion before it ended: {LIMIT_REASON[kind]}"
    assert set_point(application) == start
    moved_to(application, offset(start, A1=0.05))


@pytest.mark.parametrize("where", ["far", "outside the limits"])
@pytest.mark.parametrize("kind", SERVO_KINDS)
def test_a_moving_arm_brakes_where_it_is_sent_to_a_pose_it_cannot_reach(kind: MotionKind, where: str) -> None:
    application, flange, start = joined()
    motion = application.start(kind, offset(start, A1=0.08))
    application.run(0.05)
    assert set_point(application) != start
    done = application.set_destination(motion, FAR if where == "far" else out_of_limits(flange))
    assert (done.error, done.reason) == (RequestError.COMMAND_INVALID, LIMIT_REASON[kind])
    assert done.detail.startswith("unreachable" if where == "far" else "outside its limits: A4 at ")
    assert [(end.end, end.reason, end.detail) for end in application.ends] == [
        (MotionEnd.FAILED, LIMIT_REASON[kind], done.detail)
    ]
    assert application.bench.controller.motion.phase is Phase.BRAKING
    assert [stop.reason for stop in application.bench.controller.stops] == [f"{done.reason}: {done.detail}"]
    application.run(1.0)
    assert application.bench.controller.motion.at_rest
    again = application.set_destination(motion, flange.at(start))
    assert (again.error, again.reason) == (RequestError.COMMAND_INVALID, LIMIT_REASON[kind])
    moved_to(application, start)
    assert_no_jump(application)


def test_a_pose_farther_than_five_degrees_is_none_for_a_direct_servo() -> None:
    application, flange, start = joined()
    motion = application.start(MotionKind.DIRECT_SERVO)
    done = application.set_destination(motion, flange.at(offset(start, A1=math.radians(6.0))))
    assert (done.error, done.reason) == (RequestError.COMMAND_INVALID, ErrorReason.DIRECT_SERVO_DELTA)
    assert done.detail.startswith("destination of A1 0.104720 rad is +0.104720 rad from its measured position")


def test_a_pose_with_a_target_velocity_is_for_a_smart_servo_only() -> None:
    application, flange, start = joined()
    pose = beside(flange.at(start), mm=(5.0, 0.0, 0.0), abc_deg=(0.0, 0.0, 0.0))
    motion = application.start(MotionKind.DIRECT_SERVO)
    done = application.set_destination(motion, pose, (0.1,) * 7)
    assert (done.error, done.reason) == (RequestError.COMMAND_INVALID, ErrorReason.INVALID_INPUT_VALUES)


def test_a_running_ptp_takes_no_pose_either() -> None:
    application, flange, start = joined()
    motion = application.start(MotionKind.PTP, offset(start, A1=0.2))
    done = application.set_destination(motion, flange.at(start))
    assert (done.error, done.reason) == (
        RequestError.ILLEGAL_STATE,
        "a PTP takes no new destination while it runs",
    )
    application.run_until(lambda: bool(application.ends))
    assert application.ends[0].end is MotionEnd.FINISHED


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(7))
def test_a_packet_with_a_pose_that_is_not_finite_is_none(place: int, number: float) -> None:
    """It is dropped and counted; motion and session go on, and the same request without a hole is taken."""
    application, flange, start = joined()
    motion = application.start(MotionKind.SMART_SERVO)
    pose = Pose.from_quaternion(flange.at(offset(start, A1=0.1)).position_m, (0.1, 0.7, 0.2, 0.3))
    numbers = (*pose.position_m, *pose.quaternion_wxyz())
    last = application.states[-1].sequence
    request = SetDestination(application.number + 1, motion, None, None, pose)
    packet = application.bench.codec.encode_from_client(Command(application.token, 10**6, last, 0, False, (request,)))
    whole, hole = struct.pack("<d", numbers[place]), struct.pack("<d", number)
    assert packet.count(whole) == 1
    application.bench.deliver(packet.replace(whole, hole), application.address)
    application.run(0.02)
    assert application.bench.dropped(Outcome.UNDECODABLE) == 1
    assert application.motion(motion).phase is MotionPhase.ACTIVE
    assert set_point(application) == start
    assert application.set_destination(motion, flange.at(offset(start, A1=0.05))).error is RequestError.NONE


@pytest.mark.parametrize("kind", list(MotionKind))
@pytest.mark.parametrize("place", range(12))
def test_the_core_says_what_is_not_finite_itself(kind: MotionKind, place: int) -> None:
    """Whatever codec it is given."""
    flange = Flange("lbr-iiwa-7-r800")
    start = at()
    x, y, z, rotation = flange.at(start.position_rad)
    numbers = [x, y, z, *rotation]
    numbers[place] = math.nan
    pose = Pose(numbers[0], numbers[1], numbers[2], tuple(numbers[3:]))  # type: ignore[arg-type]
    motion = MOTIONS[kind](MotionParameters(), basis=basis_of(), destination=pose)
    fault = motion.begin(start, measured_rad=start.position_rad, now_ns=0)
    assert isinstance(fault, Fault)
    assert fault.reason == ErrorReason.INVALID_INPUT_VALUES
    assert "nan" in fault.detail
    assert motion.axes_of(pose, near_rad=start.position_rad) == fault
