"""Motions asked for over the servo link: their way through the queue, take-overs, stops, errors; in virtual time."""

import itertools
import math
from collections.abc import Callable

import pytest

from backends.ideal import IdealBackend
from backends.mujoco import MujocoBackend
from backends.robots import load_pinocchio
from hil.core.controller import FRI_LINK
from hil.core.events import MotionBegan, MotionOver
from hil.core.model import ArmModel
from hil.core.motion.executive import Phase
from hil.core.motion.queue import BLENDED, REACHED, RESTED, STOPPED
from hil.core.settings import FriSettings, ReactionSettings
from hil.values.arm import ArmState, JointCommand
from hil.values.fri import OperationMode, Release, SessionState
from hil.values.link import Source
from hil.values.motion import (
    MAX_MOTIONS,
    ErrorReason,
    FineInterpolatorState,
    MotionEnd,
    MotionKind,
    MotionParameters,
    MotionPhase,
)
from hil.values.robot import RobotDescription
from hil.values.servo import RequestError, SetDestination, SetRuntimeParameters, StartMotion, StopMotion
from tests.support.servo_virtual import Application, ServoBench, offset
from tests.support.virtual import PEER, Client
from transport.fri import FriCodec

DEGREE = math.pi / 180
SERVO_KINDS = [MotionKind.SMART_SERVO, MotionKind.DIRECT_SERVO]


def joined(**options: object) -> Application:
    application = Application(ServoBench(**options))  # type: ignore[arg-type]
    application.join()
    return application


def start_of(application: Application) -> tuple[float, ...]:
    return application.bench.description.initial_position_rad


def assert_no_jump(application: Application) -> None:
    """Between two cycles no set point moves farther than its axis may."""
    limits = application.bench.description.limits.velocity_rad_s
    for axis in range(7):
        for here, there in itertools.pairwise(application.bench.commanded(axis)):
            assert abs(there - here) <= limits[axis] * 1e-3 * (1 + 1e-6), (axis, here, there)


@pytest.mark.parametrize("kind", list(MotionKind))
def test_a_motion_goes_exactly_to_its_destination(kind: MotionKind) -> None:
    application = joined()
    goal = offset(start_of(application), A1=0.05, A4=-0.08)
    motion = application.start(kind, goal)
    application.run_until(lambda: bool(application.goals))
    assert application.goals[0].motion == motion
    assert application.bench.controller.motion.set_point.position_rad == goal
    assert application.states[-1].snapshot.commanded_position == goal
    assert application.bench.commanded(0)[-1] == goal[0]
    assert_no_jump(application)


@pytest.mark.parametrize("kind", SERVO_KINDS)
def test_a_servo_motion_without_a_destination_rests_where_it_begins(kind: MotionKind) -> None:
    application = joined()
    motion = application.start(kind)
    application.run(0.02)
    shown = application.motion(motion)
    assert shown.phase is MotionPhase.ACTIVE
    assert shown.interpolator is FineInterpolatorState.RESTING
    assert shown.destination == start_of(application)


@pytest.mark.parametrize("kind", SERVO_KINDS)
def test_a_new_destination_replaces_the_one_under_way(kind: MotionKind) -> None:
    application = joined()
    start = start_of(application)
    motion = application.start(kind, start)
    application.set_destination(motion, offset(start, A1=0.08))
    application.run(0.01)
    final = offset(start, A1=-0.05 if kind is MotionKind.SMART_SERVO else -0.02)
    done = application.set_destination(motion, final)
    assert done.error is RequestError.NONE
    assert 0 <= application.bench.now_ns - done.at_ns <= 1_000_000
    assert application.motion(motion).destination == final
    assert application.motion(motion).interpolator is FineInterpolatorState.MOVING
    application.run_until(lambda: application.bench.controller.motion.set_point.position_rad == final)
    assert_no_jump(application)


def test_the_goal_is_reported_once_for_each_destination_that_was_reached() -> None:
    application = joined()
    start = start_of(application)
    motion = application.start(MotionKind.SMART_SERVO, start)
    for step in range(1, 4):
        application.set_destination(motion, offset(start, A1=0.01 * step))
        application.run_until(lambda: application.motion(motion).interpolator is FineInterpolatorState.RESTING)
        application.run(0.02)
    reached = [goal.position[0] - start[0] for goal in application.goals]
    assert reached[-3:] == pytest.approx([0.01, 0.02, 0.03], abs=1e-4)
    assert application.motion(motion).goals_reached == len(application.goals)


def test_remaining_time_counts_down_to_the_goal() -> None:
    application = joined(reaction=ReactionSettings())
    motion = application.start(MotionKind.SMART_SERVO)
    application.run(0.05)
    application.set_destination(motion, offset(start_of(application), A1=0.3))
    first = application.motion(motion).remaining_s
    began_ns = application.bench.now_ns
    application.run_until(lambda: bool(application.goals) and application.motion(motion).remaining_s == 0.0)
    took_s = (application.goals[-1].at_ns - began_ns) * 1e-9
    assert first == pytest.approx(took_s, abs=0.005)


def test_a_resting_motion_ends_after_its_timeout() -> None:
    application = joined()
    parameters = MotionParameters(timeout_after_goal_s=0.5)
    motion = application.start(MotionKind.SMART_SERVO, offset(start_of(application), A1=0.01), parameters)
    application.run_until(lambda: bool(application.ends))
    end = application.ends[0]
    assert (end.motion, end.end, end.reason) == (motion, MotionEnd.FINISHED, RESTED)
    assert end.at_ns - application.goals[0].at_ns == pytest.approx(0.5e9, abs=2e6)
    late = application.set_destination(motion, start_of(application))
    assert (late.error, late.reason) == (RequestError.COMMAND_INVALID, RESTED)
    assert application.bench.controller.motion.phase is Phase.HOLDING


def test_stopping_brakes_and_later_destinations_are_refused() -> None:
    application = joined()
    motion = application.start(MotionKind.SMART_SERVO, offset(start_of(application), A1=1.0))
    application.run(0.6)
    assert application.stop(motion).error is RequestError.NONE
    assert application.ends[0].reason == STOPPED
    assert application.bench.controller.motion.phase is Phase.BRAKING
    application.run(1.0)
    assert application.bench.controller.motion.at_rest
    late = application.set_destination(motion, start_of(application))
    assert (late.error, late.reason) == (RequestError.COMMAND_INVALID, STOPPED)
    assert application.stop(motion).reason == STOPPED
    assert list(application.bench.controller.stops) == []
    assert_no_jump(application)


def test_a_motion_can_begin_after_a_stop_without_a_new_session() -> None:
    application = joined()
    for _ in range(3):
        motion = application.start(MotionKind.SMART_SERVO, offset(start_of(application), A1=0.5))
        application.run(0.3)
        application.stop(motion)
    application.start(MotionKind.PTP, start_of(application))
    application.run_until(lambda: application.bench.controller.motion.set_point.position_rad == start_of(application))
    assert_no_jump(application)


@pytest.mark.parametrize(("first", "second"), list(itertools.product(MotionKind, MotionKind)))
def test_a_second_motion_waits_and_takes_over_without_a_jump(first: MotionKind, second: MotionKind) -> None:
    application = joined()
    start = start_of(application)
    away = offset(start, A1=0.08, A2=0.05)
    one = application.start(first, away)
    two = application.start(second, None if second is not MotionKind.PTP else start)
    three = application.start(MotionKind.SMART_SERVO, start)
    application.run(0.06)
    assert [motion.phase for motion in application.states[-1].snapshot.motions] == [
        MotionPhase.ACTIVE,
        MotionPhase.TRANSFERRED,
        MotionPhase.QUEUED,
    ]
    moving = application.bench.commanded(0)[-1] - application.bench.commanded(0)[-2]
    assert moving > 0
    application.stop(one)
    next_step = application.bench.commanded(0)[-1] - application.bench.commanded(0)[-2]
    assert next_step == pytest.approx(moving, rel=0.2)
    assert application.bench.controller.motion.phase is Phase.APPLICATION
    assert application.motion(two).phase is MotionPhase.ACTIVE
    if second is not MotionKind.PTP:
        application.run(1.0)
        application.stop(two)
    application.run_until(lambda: bool(application.goals) and application.goals[-1].motion == three)
    assert application.bench.controller.motion.set_point.position_rad == start
    assert_no_jump(application)


def test_every_point_of_queued_ptps_is_addressed() -> None:
    application = joined()
    start = start_of(application)
    points = [offset(start, A1=0.2), offset(start, A1=0.2, A2=0.1), start]
    numbers = [application.start(MotionKind.PTP, point) for point in points]
    application.run_until(lambda: len(application.ends) == 3)
    assert [(end.motion, end.end, end.reason) for end in application.ends] == [
        (number, MotionEnd.FINISHED, REACHED) for number in numbers
    ]
    path = [tuple(command.position_rad) for command in application.bench.backend.commands]  # type: ignore[attr-defined]
    places = [path.index(tuple(point)) for point in points[:2]]
    assert places == sorted(places)
    assert [path[place + 1] == path[place] or path[place - 1] != path[place] for place in places] == [True, True]
    assert_no_jump(application)


def test_blended_ptps_pass_the_point_without_a_stop_and_are_quicker() -> None:
    def times(blending: float) -> tuple[float, float]:
        application = joined()
        start = start_of(application)
        corner, end = offset(start, A1=0.4), offset(start, A1=0.4, A2=0.3)
        began_ns = application.bench.now_ns
        application.start(MotionKind.PTP, corner, MotionParameters(blending_rel=blending))
        application.start(MotionKind.PTP, end)
        application.run_until(lambda: len(application.ends) == 2)
        path = [command.position_rad for command in application.bench.backend.commands]  # type: ignore[attr-defined]
        nearest = min(math.dist(position, corner) for position in path)
        assert application.ends[0].reason == (BLENDED if blending else REACHED)
        assert application.bench.controller.motion.set_point.position_rad == end
        assert_no_jump(application)
        return nearest, (application.bench.now_ns - began_ns) * 1e-9

    exact, blended = times(0.0), times(0.3)
    assert exact[0] == 0.0
    assert 1e-4 < blended[0] < 0.3 * 0.4
    assert blended[1] < exact[1] - 0.05


def test_blending_needs_the_next_ptp_in_time() -> None:
    application = joined()
    corner = offset(start_of(application), A1=0.2)
    application.start(MotionKind.PTP, corner, MotionParameters(blending_rel=0.5))
    application.start(MotionKind.SMART_SERVO)
    application.run_until(lambda: len(application.ends) == 1)
    assert application.ends[0].reason == REACHED
    assert corner[0] in application.bench.commanded(0)


@pytest.mark.parametrize("how", ["goodbye", "close", "withdrawn"])
def test_between_two_motions_everything_may_leave(how: str) -> None:
    application = joined()
    bench, start = application.bench, start_of(application)
    application.start(MotionKind.PTP, offset(start, A4=0.1))
    waiting = application.start(MotionKind.PTP, offset(start, A4=0.5))
    application.run_until(lambda: len(bench.controller.motion.applications) == 1)
    assert bench.controller.motion.applications.active is None
    if how == "goodbye":
        application.goodbye()
    elif how == "close":
        bench.controller.close(now_ns=bench.now_ns)
    else:
        application.stop(waiting)
    bench.cycle()
    bench.cycle()
    assert bench.controller.motion.at_rest
    assert bench.commanded(3)[-1] == start[3] + 0.1
    bench.controller.close(now_ns=bench.now_ns)
    bench.run(0.01)
    assert bench.controller.closed


def test_a_stop_and_a_bad_destination_in_one_packet_brake_the_arm() -> None:
    application = joined()
    start = start_of(application)
    one = application.start(MotionKind.SMART_SERVO, offset(start, A4=0.5))
    two = application.start(MotionKind.SMART_SERVO)
    application.run(0.3)
    application.ask(lambda number: StopMotion(number, one), lambda number: SetDestination(number, two, (99.0,) * 7))
    application.run(1.0)
    assert application.bench.controller.motion.at_rest
    assert application.bench.controller.motion.phase is Phase.HOLDING
    assert_no_jump(application)
    [stop] = application.bench.controller.stops
    assert "RML_ERROR_POSITIONAL_LIMITS" in stop.reason


def test_the_queue_is_bounded() -> None:
    application = joined()
    for _ in range(MAX_MOTIONS):
        application.start(MotionKind.SMART_SERVO)
    [done] = application.ask(lambda number: StartMotion(number, MotionKind.SMART_SERVO, MotionParameters(), None))
    assert (done.error, done.reason) == (
        RequestError.ILLEGAL_STATE,
        "16 motions run or wait already, no more are taken",
    )


def test_calls_in_the_wrong_state_are_refused_and_the_session_lives() -> None:
    application = joined()
    one = application.start(MotionKind.SMART_SERVO)
    ptp = application.start(MotionKind.PTP, start_of(application))
    answers = application.ask(
        lambda number: StopMotion(number, 999),
        lambda number: SetDestination(number, 999, start_of(application)),
        lambda number: SetDestination(number, ptp, start_of(application)),
    )
    assert [(done.error, done.reason) for done in answers] == [
        (RequestError.ILLEGAL_STATE, "there is no motion 999"),
        (RequestError.ILLEGAL_STATE, "there is no motion 999"),
        (RequestError.ILLEGAL_STATE, "a PTP takes no new destination while it runs"),
    ]
    application.run(0.05)
    assert application.motion(one).phase is MotionPhase.ACTIVE


def test_a_waiting_motion_can_be_withdrawn_and_the_others_stay() -> None:
    application = joined()
    start = start_of(application)
    one = application.start(MotionKind.SMART_SERVO)
    wrong = application.start(MotionKind.PTP, offset(start, A1=1.0))
    three = application.start(MotionKind.PTP, offset(start, A1=0.05))
    assert application.stop(wrong).error is RequestError.NONE
    assert [(end.motion, end.end) for end in application.ends] == [(wrong, MotionEnd.STOPPED)]
    application.stop(one)
    application.run_until(lambda: len(application.ends) == 3)
    assert (application.ends[-1].motion, application.ends[-1].end) == (three, MotionEnd.FINISHED)
    assert max(application.bench.commanded(0)) == start[0] + 0.05


def test_a_destination_for_a_waiting_motion_is_where_it_will_go() -> None:
    application = joined()
    start = start_of(application)
    one = application.start(MotionKind.SMART_SERVO)
    two = application.start(MotionKind.SMART_SERVO)
    assert application.set_destination(two, offset(start, A1=0.05)).error is RequestError.NONE
    application.run(0.1)
    assert application.bench.commanded(0)[-1] == start[0]
    application.stop(one)
    application.run_until(lambda: application.bench.commanded(0)[-1] == start[0] + 0.05)


@pytest.mark.parametrize(
    ("kind", "position", "velocity", "reason"),
    [
        (MotionKind.SMART_SERVO, None, None, ErrorReason.NULL_POINTER),
        (MotionKind.DIRECT_SERVO, None, None, ErrorReason.NULL_POINTER),
        (MotionKind.SMART_SERVO, (0.0,) * 6, None, ErrorReason.NUMBER_OF_DOFS),
        (MotionKind.DIRECT_SERVO, (0.0,) * 8, None, ErrorReason.NUMBER_OF_DOFS),
        (MotionKind.SMART_SERVO, (math.nan,) + (0.0,) * 6, None, ErrorReason.INVALID_INPUT_VALUES),
        (MotionKind.DIRECT_SERVO, (math.inf,) + (0.0,) * 6, None, ErrorReason.INVALID_INPUT_VALUES),
        (MotionKind.SMART_SERVO, (3.0,) + (0.0,) * 6, None, ErrorReason.POSITIONAL_LIMITS),
        (MotionKind.SMART_SERVO, (0.0,) * 7, (9.0,) + (0.0,) * 6, ErrorReason.SPEED_LIMIT),
        (MotionKind.SMART_SERVO, (0.0,) * 7, (math.nan,) * 7, ErrorReason.INVALID_INPUT_VALUES),
        (MotionKind.SMART_SERVO, (0.0,) * 7, (0.1,) * 3, ErrorReason.NUMBER_OF_DOFS),
        (MotionKind.DIRECT_SERVO, (0.0, 0.52, 0.0, 0.7, 0.0, 1.57, 6 * DEGREE), None, ErrorReason.DIRECT_SERVO_DELTA),
        (MotionKind.DIRECT_SERVO, (0.0, 0.52, 0.0, 0.7, 0.0, 1.57, 0.0), (0.1,) * 7, ErrorReason.INVALID_INPUT_VALUES),
    ],
)
def test_a_destination_that_cannot_be_ends_the_motion_with_the_manuals_reason(
    kind: MotionKind, position: tuple[float, ...] | None, velocity: tuple[float, ...] | None, reason: ErrorReason
) -> None:
    application = joined()
    motion = application.start(kind, offset(start_of(application), A1=0.08))
    application.start(MotionKind.SMART_SERVO)
    application.run(0.03)
    done = application.set_destination(motion, position, velocity)
    assert (done.error, done.reason) == (RequestError.COMMAND_INVALID, reason)
    assert done.detail
    assert [(end.end, end.reason) for end in application.ends] == [
        (MotionEnd.FAILED, reason),
        (MotionEnd.FAILED, f"a motion before it ended: {reason}"),
    ]
    assert [stop.reason for stop in application.bench.controller.stops] == [f"{reason}: {done.detail}"]
    application.run(1.0)
    assert application.bench.controller.motion.at_rest
    again = application.set_destination(motion, start_of(application))
    assert (again.error, again.reason) == (RequestError.COMMAND_INVALID, reason)
    application.start(MotionKind.PTP, start_of(application))
    application.run_until(lambda: application.bench.controller.motion.set_point.position_rad == start_of(application))
    assert_no_jump(application)


def test_direct_servo_out_of_the_axis_range() -> None:
    application = joined()
    high = application.bench.description.limits.position_max_rad[6]
    application.start(MotionKind.PTP, (*start_of(application)[:6], high - 0.01))
    application.run_until(lambda: len(application.ends) == 1)
    motion = application.start(MotionKind.DIRECT_SERVO)
    done = application.set_destination(motion, (*start_of(application)[:6], high + 0.01))
    assert done.reason == ErrorReason.DIRECT_SERVO_LIMIT


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        (MotionParameters(joint_velocity_rel=0.0), ErrorReason.INVALID_INPUT_VALUES),
        (MotionParameters(joint_velocity_rel=1.5), ErrorReason.OVERRIDE_OUT_OF_RANGE),
        (MotionParameters(joint_jerk_percent=1e-200), ErrorReason.INVALID_INPUT_VALUES),
        (MotionParameters(acceleration_override=5e-324), ErrorReason.INVALID_INPUT_VALUES),
        (MotionParameters(joint_acceleration_rel=-0.1), ErrorReason.OVERRIDE_OUT_OF_RANGE),
        (MotionParameters(acceleration_override=21.0), ErrorReason.OVERRIDE_OUT_OF_RANGE),
        (MotionParameters(joint_jerk_percent=math.nan), ErrorReason.OVERRIDE_OUT_OF_RANGE),
        (MotionParameters(minimum_execution_time_s=-1.0), ErrorReason.USER_TIME_OUT_OF_RANGE),
        (MotionParameters(minimum_execution_time_s=1e9), ErrorReason.USER_TIME_OUT_OF_RANGE),
        (MotionParameters(joint_velocity_rel=1e-6), ErrorReason.EXECUTION_TIME_TOO_BIG),
    ],
)
def test_parameters_no_interpolator_can_work_with_end_the_motion(
    parameters: MotionParameters, reason: ErrorReason
) -> None:
    application = joined()
    motion = application.start(MotionKind.SMART_SERVO, offset(start_of(application), A1=0.5), parameters)
    application.run(0.02)
    end = application.ends[-1]
    assert (end.motion, end.end, end.reason) == (motion, MotionEnd.FAILED, reason)
    assert application.bench.commanded(0)[-1] == start_of(application)[0]


def test_runtime_parameters_change_while_the_motion_runs() -> None:
    application = joined()
    motion = application.start(MotionKind.SMART_SERVO)
    [good, bad] = application.ask(
        lambda number: SetRuntimeParameters(number, motion, minimum_execution_time_s=2.0, velocity_planning=True),
        lambda number: SetRuntimeParameters(number, motion, minimum_execution_time_s=-2.0),
    )
    assert good.error is RequestError.NONE
    assert (bad.error, bad.reason) == (RequestError.ILLEGAL_ARGUMENT, ErrorReason.USER_TIME_OUT_OF_RANGE)
    began_ns = application.bench.now_ns
    application.set_destination(motion, offset(start_of(application), A1=0.01))
    application.run_until(lambda: application.bench.commanded(0)[-1] == start_of(application)[0] + 0.01)
    assert application.bench.now_ns - began_ns == pytest.approx(2.0e9, abs=5e6)


def test_velocity_goes_on_after_the_goal_for_its_timeout() -> None:
    application = joined()
    parameters = MotionParameters(speed_timeout_s=0.2, velocity_planning=True)
    motion = application.start(MotionKind.SMART_SERVO, None, parameters)
    goal, speed = start_of(application)[0] + 0.1, 0.2
    application.set_destination(motion, offset(start_of(application), A1=0.1), (speed,) + (0.0,) * 6)
    application.run_until(
        lambda: application.motion(motion).interpolator is FineInterpolatorState.VELOCITY_AFTER_GOAL_REACH
    )
    application.run(0.1)
    path = application.bench.commanded(0)
    assert (path[-1] - path[-2]) / 1e-3 == pytest.approx(speed, rel=1e-6)
    application.run_until(lambda: application.motion(motion).interpolator is FineInterpolatorState.RESTING)
    application.run(1.0)
    rested = application.bench.commanded(0)[-1]
    assert rested > goal + 0.2 * speed
    assert application.bench.commanded(0)[-2] == rested


def test_in_t1_a_motion_that_is_too_fast_ends_with_the_manuals_reason() -> None:
    application = joined(mode=OperationMode.T1)
    parameters = MotionParameters(joint_jerk_percent=500, acceleration_override=20)
    application.start(MotionKind.SMART_SERVO, offset(start_of(application), A1=1.5), parameters)
    application.run_until(lambda: bool(application.ends))
    end = application.ends[0]
    assert (end.end, end.reason) == (MotionEnd.FAILED, ErrorReason.COMMANDED_T1)
    assert "mm/s, the limit is 250 mm/s" in end.detail
    application.run(1.0)
    assert application.bench.controller.motion.at_rest
    model = ArmModel(load_pinocchio("lbr-iiwa-14-r820"))
    commands = application.bench.backend.commands  # type: ignore[attr-defined]
    assert max(model.flange_speed_mm_s(command.position_rad, command.velocity_rad_s) for command in commands) <= 250.0


def test_a_velocity_next_to_nothing_for_ever_is_borne() -> None:
    application = joined()
    parameters = MotionParameters(velocity_planning=True, speed_timeout_s=1.7e308)
    motion = application.start(MotionKind.SMART_SERVO, None, parameters)
    application.set_destination(motion, offset(start_of(application), A1=0.01), (1e-308,) + (0.0,) * 6)
    application.run(1.5)
    assert application.motion(motion).interpolator is FineInterpolatorState.VELOCITY_AFTER_GOAL_REACH
    application.stop(motion)
    application.run(0.5)
    assert application.bench.controller.motion.at_rest


class StuckArm(IdealBackend):
    """An arm that does not move: every joint is blocked."""

    def _write(self, command: JointCommand) -> None:
        super()._write(JointCommand(self._position, (0.0,) * 7))


def test_an_arm_that_cannot_follow_stops_with_a_tracking_error() -> None:
    application = joined(backend=StuckArm)
    application.start(MotionKind.SMART_SERVO, offset(start_of(application), A2=0.5))
    application.run_until(lambda: bool(application.ends))
    end = application.ends[0]
    assert end.reason == ErrorReason.TRACKING_ERROR
    assert "A2 is +0.1" in end.detail
    application.run(1.0)
    assert application.bench.controller.motion.at_rest


@pytest.mark.parametrize(("kind", "reaction_ms"), [(MotionKind.SMART_SERVO, 22.0), (MotionKind.DIRECT_SERVO, 12.0)])
def test_the_reaction_time_lies_between_destination_and_motion(kind: MotionKind, reaction_ms: float) -> None:
    application = joined(reaction=ReactionSettings())
    start = start_of(application)
    motion = application.start(kind)
    application.run(0.1)
    done = application.set_destination(motion, offset(start, A1=0.05))
    application.run_until(lambda: abs(application.bench.commanded(0)[-1] - start[0]) > 1e-6)
    assert (application.bench.now_ns - done.at_ns) * 1e-6 == pytest.approx(reaction_ms, abs=3.0)


def test_events_tell_every_motion() -> None:
    application = joined()
    motion = application.start(MotionKind.PTP, offset(start_of(application), A1=0.05))
    application.run_until(lambda: bool(application.ends))
    told = [str(event) for event in application.bench.events if isinstance(event, MotionBegan | MotionOver)]
    assert told == [f"motion {motion} (PTP) begins", f"motion {motion} (PTP) finished: the point was reached"]


def test_the_fri_client_and_an_application_never_have_the_arm_at_once() -> None:
    bench = ServoBench(fri=FriSettings(peer=PEER))
    fri = bench.controller.fri
    assert fri is not None
    client = Client(FriCodec(Release.V1_15))
    application = Application(bench, watchdog_ms=1000)

    def with_client(condition: Callable[[], bool]) -> None:
        for _ in range(6000):
            if condition():
                return
            application.command()
            bench.cycle()
            answer = client.answer(bench.fri_sent[-1])
            if answer is not None:
                bench.controller.receive(answer, Source(FRI_LINK, PEER), now_ns=bench.now_ns + 200_000)
        raise AssertionError(bench.told()[-3:])

    with_client(lambda: fri.state is SessionState.COMMANDING_ACTIVE)
    application.join()
    [done] = application.ask(lambda number: StartMotion(number, MotionKind.PTP, MotionParameters(), None))
    assert done.error is RequestError.ILLEGAL_STATE
    assert done.reason.startswith("the FRI client commands the arm")
    assert bench.controller.motion.phase is Phase.OVERLAY
    client.answers = lambda _: False
    with_client(lambda: fri.state < SessionState.COMMANDING_WAIT and bench.controller.motion.at_rest)
    client.answers = lambda _: True
    motion = application.start(MotionKind.SMART_SERVO)
    with_client(lambda: any("commands the arm over the servo link" in told for told in bench.told()))
    assert fri.state is SessionState.MONITORING_READY
    assert application.motion(motion).phase is MotionPhase.ACTIVE


@pytest.mark.parametrize("robot", ["lbr-iiwa-7-r800", "lbr-iiwa-14-r820", "lbr-med-7", "lbr-med-14"])
def test_the_mujoco_arm_follows_smart_servo(robot: str) -> None:
    def final_error(description: RobotDescription) -> float:
        bench = ServoBench(robot=robot, backend=MujocoBackend)
        application = Application(bench)
        application.join()
        goal = offset(description.initial_position_rad, A1=0.3, A2=-0.2, A4=0.2, A6=-0.3)
        application.start(MotionKind.SMART_SERVO, goal)
        application.run_until(lambda: bool(application.goals))
        application.run(0.3)
        assert list(bench.controller.stops) == []
        measured: ArmState = bench.backend.read()
        return max(abs(there - here) for there, here in zip(measured.position_rad, goal, strict=True))

    assert final_error(ServoBench(robot=robot).description) < 1e-3
