"""Motions, their parameters, errors, the statistic timer: what an application holds in its hands before it is moved."""

import math
import statistics
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hil.client.servo as public
from hil.client.servo import (
    PTP,
    AsyncDirectServo,
    AsyncPTP,
    AsyncServoClient,
    AsyncSmartServo,
    CommandInvalidException,
    ConfigurationError,
    DirectServo,
    EndpointError,
    HilError,
    IllegalArgumentException,
    IllegalStateException,
    MotionKind,
    MotionParameters,
    OutOfRange,
    PositionControlMode,
    Role,
    ServoClient,
    SessionEnded,
    SmartServo,
    StatisticTimer,
    UsageError,
)
from hil.client.servo.motions import Motion
from hil.values.servo import MAX_VECTOR_NUMBERS, StartMotion
from tests.support.servo_controller import START

NOT_ACTIVE = "waitForTransferred called prematurely - RealtimeMotion is not active"
SMART, DIRECT, PLAIN = (SmartServo, AsyncSmartServo), (DirectServo, AsyncDirectServo), (PTP, AsyncPTP)


def made(kind: type[Motion]) -> Motion:
    return kind(START)


def test_everything_exported_is_there_and_sorted() -> None:
    assert list(public.__all__) == sorted(public.__all__, key=lambda name: (not name.isupper(), name))
    assert all(hasattr(public, name) for name in public.__all__)


@pytest.mark.parametrize("kind", [*SMART, *DIRECT, *PLAIN])
def test_a_motion_begins_with_the_manuals_defaults(kind: type[Motion]) -> None:
    assert made(kind).request(3) == StartMotion(3, made(kind).kind, MotionParameters(), START)
    defaults = MotionParameters()
    assert (defaults.joint_velocity_rel, defaults.joint_acceleration_rel, defaults.acceleration_override) == (1, 1, 1)
    assert (defaults.minimum_execution_time_s, defaults.speed_timeout_s, defaults.timeout_after_goal_s) == (
        0.01,
        0,
        120,
    )


def test_servo_motions_need_no_destination() -> None:
    for motion, kind in ((SmartServo(), MotionKind.SMART_SERVO), (DirectServo(), MotionKind.DIRECT_SERVO)):
        assert motion.request(1) == StartMotion(1, kind, MotionParameters(), None)


def test_setters_chain_and_set() -> None:
    motion = (
        SmartServo()
        .set_joint_velocity_rel(0.5)
        .set_joint_acceleration_rel(0.25)
        .set_minimum_trajectory_execution_time(0.02)
        .set_speed_timeout_after_goal_reach(0.1)
        .set_timeout_after_goal_reach(3)
        .override_joint_acceleration(20)
        .set_joint_jerk(500)
        .set_mode(PositionControlMode())
    )
    assert motion.parameters == MotionParameters(0.5, 0.25, 20.0, 500.0, 0.02, 0.1, 3.0)
    assert PTP(START).set_blending_rel(0.3).parameters.blending_rel == 0.3
    assert DirectServo().set_joint_acceleration_rel(0.1).parameters.joint_acceleration_rel == 0.1


Setter = Callable[[Motion, float], object]
RANGES: list[tuple[type[Motion], str, float, float, str]] = [
    (SmartServo, "set_joint_velocity_rel", 0.0, 1.0, "joint velocity rel"),
    (SmartServo, "set_joint_acceleration_rel", 0.0, 1.0, "joint acceleration rel"),
    (SmartServo, "override_joint_acceleration", 0.0, 20.0, "joint acceleration override"),
    (SmartServo, "set_joint_jerk", 0.0, 1500.0, "joint jerk"),
    (SmartServo, "set_minimum_trajectory_execution_time", 0.0, math.inf, "minimum trajectory execution time"),
    (DirectServo, "set_speed_timeout_after_goal_reach", 0.0, math.inf, "speed timeout after goal reach"),
    (DirectServo, "set_timeout_after_goal_reach", 0.0, math.inf, "timeout after goal reach"),
    (PTP, "set_blending_rel", 0.0, 1.0, "blending rel"),
]


@pytest.mark.parametrize(("kind", "setter", "low", "high", "name"), RANGES)
def test_parameters_are_refused_at_the_call_with_name_value_and_range(
    kind: type[Motion], setter: str, low: float, high: float, name: str
) -> None:
    motion = made(kind)
    before = motion.parameters
    wrong = [math.nextafter(low, -1.0), -1.0, math.nan, math.inf]
    wrong += [] if math.isinf(high) else [math.nextafter(high, 2e9)]
    for value in wrong:
        with pytest.raises(OutOfRange, match=rf"^{name} \S+ is outside its range ") as caught:
            getattr(motion, setter)(value)
        assert (caught.value.name, caught.value.valid.startswith((f"{low:g} ...", f">= {low:g}"))) == (name, True)
    with pytest.raises(ConfigurationError, match=rf"^{name} is 'fast'; a number"):
        getattr(motion, setter)("fast")
    assert motion.parameters == before
    for value in (low, min(high, 1e6)):
        assert getattr(motion, setter)(value) is motion


def test_what_is_no_control_mode_is_refused_in_words() -> None:
    with pytest.raises(IllegalArgumentException, match="is no control mode; one of PositionControlMode"):
        SmartServo().set_mode("stiff")  # type: ignore[arg-type]


def test_destinations_are_any_sequence_and_travel_as_they_are() -> None:
    for position in (START, list(START), np.array(START), np.array(START, dtype=np.float64)[:]):
        assert PTP(position).destination == START
    # Judging these is the controller's: it answers with the manual's errors.
    assert SmartServo([]).destination == ()
    assert SmartServo([1, 2]).destination == (1.0, 2.0)
    wrong = SmartServo([math.nan] * 8).destination
    assert wrong is not None
    assert len(wrong) == 8
    assert len(PTP([0.0] * MAX_VECTOR_NUMBERS).destination or ()) == MAX_VECTOR_NUMBERS


@pytest.mark.parametrize(
    ("position", "words"),
    [
        ([0.0] * 33, "destination has 33 numbers; at most 32 can be sent"),
        (["a"] * 7, r"destination is \['a', .*\]; a sequence of seven numbers is needed"),
        (1.0, r"destination is 1\.0; a sequence of seven numbers is needed"),
        (np.zeros((7, 2)), "a sequence of seven numbers is needed"),
    ],
)
def test_what_cannot_travel_is_refused_at_the_call(position: list[float], words: str) -> None:
    with pytest.raises(IllegalArgumentException, match=words):
        SmartServo(position)


def test_a_motion_that_was_not_started_has_no_runtime() -> None:
    motion = SmartServo()
    for call in (motion.get_runtime, motion.stop_motion, motion.wait_until_ended):
        with pytest.raises(IllegalStateException) as caught:
            call()
        assert str(caught.value) == NOT_ACTIVE


async def test_a_motion_that_was_not_started_has_no_runtime_in_asyncio_either() -> None:
    motion = AsyncDirectServo()
    for call in (motion.get_runtime, motion.stop_motion, motion.wait_until_ended):
        with pytest.raises(IllegalStateException) as caught:
            await call()
        assert str(caught.value) == NOT_ACTIVE


async def test_a_motion_of_the_other_kind_of_client_is_refused() -> None:
    with pytest.raises(IllegalArgumentException, match="AsyncPTP is a motion for AsyncServoClient, not for Serv"):
        ServoClient().move(AsyncPTP(START))  # type: ignore[arg-type]
    with pytest.raises(IllegalArgumentException, match="PTP is a motion for ServoClient, not for AsyncServoCl"):
        await AsyncServoClient().move_async(PTP(START))  # type: ignore[arg-type]


# Errors


def test_the_command_invalid_text_is_the_manuals_and_the_detail_is_a_note() -> None:
    error = CommandInvalidException("tracking error", "A3 is 0.2000 rad behind")
    assert str(error) == "Command is no longer active, because tracking error"
    assert (error.error_reason, error.detail) == ("tracking error", "A3 is 0.2000 rad behind")
    assert error.__notes__ == ["A3 is 0.2000 rad behind"]
    assert not hasattr(CommandInvalidException("tracking error"), "__notes__")


@pytest.mark.parametrize(
    ("reason", "words"),
    [
        ("silent for 400 ms, the watchdog allows 300 ms", "A larger watchdog_ms bears that"),
        (
            "silent for 400 ms, the watchdog allows 300 ms; late: 20.0 ms over its latency budget of 30 ms",
            "A larger latency_budget_ms bears that",
        ),
    ],
)
def test_a_session_that_was_silent_or_late_says_what_bears_that(reason: str, words: str) -> None:
    [note] = SessionEnded(reason).__notes__
    assert note.endswith(words)
    assert not hasattr(SessionEnded("the operator took over"), "__notes__")


def test_the_tree_of_errors() -> None:
    assert issubclass(IllegalArgumentException, UsageError)
    assert issubclass(IllegalStateException, ValueError)
    assert issubclass(CommandInvalidException, HilError)
    assert not issubclass(CommandInvalidException, UsageError | EndpointError)


# The client's own arguments


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"watchdog_ms": 19}, r"^watchdog 19 is outside its range 20 \.\.\. 10000 ms$"),
        ({"watchdog_ms": 10_001}, r"^watchdog 10001 is outside"),
        ({"watchdog_ms": 20.5}, r"^watchdog 20\.5 is outside its range of whole numbers, 20 \.\.\. 10000 ms$"),
        ({"state_period_ms": 0}, r"^state period 0 is outside its range 1 \.\.\. 100 ms$"),
        ({"state_period_ms": 101}, r"^state period 101 is outside"),
        ({"connect_timeout_s": -1}, r"^connect timeout -1 is outside its range 0 \.\.\. 86400 s$"),
        ({"latency_budget_ms": 14}, r"^latency budget 14 is outside its range 15 \.\.\. 300 ms$"),
        ({"latency_budget_ms": 0}, r"^latency budget 0 is outside its range 15 \.\.\. 300 ms$"),
        ({"latency_budget_ms": 301}, r"^latency budget 301 is outside its range 15 \.\.\. 300 ms$"),
        ({"latency_budget_ms": 20.5}, r"^latency budget 20\.5 is outside its range of whole numbers, 15 \.\.\. 300 ms"),
        ({"latency_budget_ms": "fast"}, r"^latency budget is 'fast'; a number 15 \.\.\. 300 ms is needed$"),
        ({"name": "ä" * 32}, r"is no printable text of at most 63 bytes$"),
        ({"name": "\ud800"}, r"is no printable text"),
        ({"role": 7}, r"7 is not a valid Role"),
    ],
)
def test_a_clients_arguments_are_refused_at_the_call(arguments: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        ServoClient(**arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("controller", ["127.0.0.1:x", "127.0.0.1:0", "no.such.host.invalid", "::1"])
def test_an_address_that_is_none_leaves_no_socket_open(controller: str) -> None:
    client = ServoClient(controller, role=Role.OBSERVER)
    with pytest.raises(UsageError, match=controller):
        client.connect()
    client.close()


def test_a_client_that_is_not_open_says_so() -> None:
    client = ServoClient()
    for call in (
        client.read_state,
        client.wait_for_state,
        lambda: client.commander,
        lambda: client.controller,
        lambda: client.operator,
    ):
        with pytest.raises(UsageError, match="not open; use it inside its with block"):
            call()
    with pytest.raises(UsageError, match="not open"):
        client.move(PTP(START))


# The statistic timer


def filled(durations_ms: list[float]) -> StatisticTimer:
    timing = StatisticTimer()
    for duration_ms in durations_ms:
        timing.add(duration_ms)
    return timing


def test_the_text_of_a_timer_is_the_manuals() -> None:
    assert str(filled([0.91, 1.92, 6.36])) == "n(3) T(0.91, 3.06, 6.36 msec) (stdDev 2.37)"
    assert str(filled([1.0])) == "n(1) T(1.00, 1.00, 1.00 msec) (stdDev 0.00)"
    assert str(StatisticTimer()) == "n(0) T(-, -, - msec) (stdDev -)"


@given(st.lists(st.floats(0.0, 1e6), min_size=1, max_size=50))
def test_statistics_in_one_pass_are_those_of_all_values(durations_ms: list[float]) -> None:
    timing = filled(durations_ms)
    assert (timing.count, timing.min_ms, timing.max_ms) == (len(durations_ms), min(durations_ms), max(durations_ms))
    assert timing.mean_ms == pytest.approx(statistics.fmean(durations_ms), abs=1e-6)
    assert timing.standard_deviation_ms == pytest.approx(statistics.pstdev(durations_ms), abs=1e-3)


def test_small_differences_of_long_times_are_not_lost() -> None:
    assert filled([1e9, 1e9 + 1.0, 1e9 + 2.0]).standard_deviation_ms == pytest.approx(math.sqrt(2 / 3))


def test_a_time_step_counts_once() -> None:
    timing = StatisticTimer()
    step = timing.new_time_step()
    assert timing.count == 0
    step.end()
    with pytest.raises(IllegalStateException, match="this time step has ended already"):
        step.end()
    with timing.new_time_step() as explicit:
        explicit.end()
    with timing.new_time_step():
        pass
    assert timing.count == 3
    assert 0.0 <= timing.min_ms <= timing.mean_ms <= timing.max_ms


def test_a_step_that_an_error_ends_does_not_count() -> None:
    timing = StatisticTimer()
    with pytest.raises(KeyError), timing.new_time_step():
        raise KeyError
    assert timing.count == 0
