"""The seconds hand effect: recognised where the arm stands before each destination, told in a sentence, cured by it."""

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.core.diagnosis.seconds_hand import IN_A_ROW, MANY, TELL_AGAIN_NS, WINDOW, SecondsHand
from hil.core.diagnosis.seconds_hand_finding import minimum_execution_times_s, seconds_hand
from hil.core.motion.direct_servo import DirectServo
from hil.core.motion.servo_motion import ServoMotion
from hil.core.motion.set_point import STILL, SetPoint
from hil.core.motion.smart_servo import SmartServo
from hil.core.motion.way_time import AxisLimits, acceleration_for, velocity_for, way_for, way_time_s
from hil.core.settings import ReactionSettings
from hil.values.finding import Finding, Severity, Whose
from hil.values.motion import MotionKind, MotionParameters
from hil.values.operator import PadKey, SetOverride
from hil.values.servo import SetRuntimeParameters
from tests.support.cases import cases
from tests.support.interpolation import START, Run, at, basis_of, moved
from tests.support.servo_virtual import MS, Application, ServoBench, offset

FAST = MotionParameters(acceleration_override=20.0, joint_jerk_percent=1500.0)
WAY_OF_12_MS_RAD = 1.3e-4
"""Of A1 with these parameters, as in the manual's figure 7-4: destinations every 21 ms, a way of 12 ms."""
SMART, DIRECT = MotionKind.SMART_SERVO, MotionKind.DIRECT_SERVO
KINDS: dict[MotionKind, type[SmartServo | DirectServo]] = {SMART: SmartServo, DIRECT: DirectServo}


def stream(
    kind: MotionKind,
    step_rad: float,
    spacing_ms: Sequence[int],
    parameters: MotionParameters | None = None,
    *,
    dead_time_ms: float = 0.0,
) -> ServoMotion:
    """Run a motion whose destinations, so far apart, go on in one direction; return it after the last one."""
    motion = KINDS[kind](parameters or MotionParameters(), basis=basis_of(dead_time_ms=dead_time_ms), destination=None)
    run = Run(motion, at())
    for number, cycles in enumerate(spacing_ms, start=1):
        assert run.go_to(moved(A1=step_rad * number)) is None
        run.cycle(cycles)
    return motion


def found(motion: ServoMotion) -> Finding:
    assert motion.seconds_hand.due
    return seconds_hand(motion, 3)


@pytest.mark.parametrize("dead_time_ms", [0.0, 22.0])
def test_the_manuals_figure_is_recognised_and_told_in_a_sentence(dead_time_ms: float) -> None:
    motion = stream(SMART, WAY_OF_12_MS_RAD, [21] * 30, FAST, dead_time_ms=dead_time_ms)
    finding = found(motion)
    assert (finding.kind, finding.severity, finding.whose) == ("seconds-hand", Severity.WARNING, Whose.APPLICATION)
    assert finding.sentence == (
        "motion 3 (SmartServo): the arm stood still before 20 of the last 20 destinations (seconds hand effect): "
        "a destination is reached in 12.0 ms, the next one comes 21.0 ms after it (at most 21.0 ms): "
        "the application sets its destinations too late for this motion, or too near"
    )
    assert finding.remedies[0] == (
        "give a destination more time: set_minimum_trajectory_execution_time(0.032) to (0.042): 1.5 to 2 x 21 ms, the "
        "cycle time of the application (now 0.010)"
    )
    assert (finding.figures["way_ms"], finding.figures["stood_ms"]) == (12.0, 9.0)


def test_a_direct_servo_that_all_but_stands_is_told_to_be_another_motion() -> None:
    finding = found(stream(DIRECT, 0.01, [60] * 12))
    assert "DirectServo" in finding.sentence
    assert "all but reached when the next one comes, 60.0 ms after it" in finding.sentence
    assert "set_minimum_trajectory_execution_time(0.090) to (0.120)" in finding.remedies[0]
    assert "use SmartServo" in finding.remedies[1]
    slower = found(stream(DIRECT, 0.002, [150] * 12))
    assert "is reached in 102.0 ms" in slower.sentence


CASES = [
    (SMART, WAY_OF_12_MS_RAD, 21, FAST),
    (SMART, 1e-3, 80, MotionParameters()),
    (SMART, 0.02, 300, MotionParameters(joint_velocity_rel=0.5)),
    (DIRECT, 0.002, 100, MotionParameters(joint_velocity_rel=0.3)),
    (DIRECT, 0.01, 60, MotionParameters()),
]


@pytest.mark.parametrize(("kind", "step_rad", "spacing_ms", "parameters"), CASES)
def test_each_remedy_makes_it_vanish(
    kind: MotionKind, step_rad: float, spacing_ms: int, parameters: MotionParameters
) -> None:
    finding = found(stream(kind, step_rad, [spacing_ms] * 12, parameters))
    advice = " ".join(finding.remedies)

    def standstills(changed: MotionParameters, times: float = 1.0) -> int:
        return stream(kind, step_rad * times, [spacing_ms] * 12, changed).seconds_hand.standstills

    assert standstills(parameters) == 11
    low_s, high_s = (float(text) for text in re.findall(r"\((0\.\d{3})\)", finding.remedies[0]))
    assert (low_s, high_s) == minimum_execution_times_s(spacing_ms)
    for time_s in (low_s, high_s):
        assert standstills(replace(parameters, minimum_execution_time_s=time_s)) == 0
    velocity_rel = number_after("set_joint_velocity_rel", advice)
    assert standstills(replace(parameters, joint_velocity_rel=velocity_rel)) == 0
    if kind is SMART:
        acceleration_rel = number_after("set_joint_acceleration_rel", advice)
        assert standstills(replace(parameters, joint_acceleration_rel=acceleration_rel)) == 0
    farther = re.search(r"set destinations ([\d.e+]+) times as far apart", advice)
    assert (farther is not None) == (kind is SMART)
    if farther is not None:
        assert standstills(parameters, float(farther[1])) == 0


def test_irregular_cycles_are_told_what_bridges_the_long_ones() -> None:
    finding = found(stream(SMART, 6e-4, [60, 11] * WINDOW, FAST))
    assert finding.figures["application_cycle_mean_ms"] == 35.5
    assert "(0.090) to (0.120): 1.5 to 2 x 60 ms, the long ones of its irregular cycles" in finding.remedies[0]
    cured = stream(SMART, 6e-4, [60, 11] * WINDOW, replace(FAST, minimum_execution_time_s=0.09))
    assert cured.seconds_hand.standstills == 0


@settings(max_examples=cases(30), deadline=None)
@given(
    kind=st.sampled_from(sorted(KINDS)),
    spacing_ms=st.lists(st.integers(1, 120), min_size=2, max_size=6),
    step_rad=st.floats(1e-6, 0.0036),  # 24 of them are within what DirectServo takes
    parameters=st.builds(
        MotionParameters,
        joint_velocity_rel=st.floats(0.01, 1.0),
        joint_acceleration_rel=st.floats(0.01, 1.0),
        acceleration_override=st.floats(0.1, 20.0),
        joint_jerk_percent=st.floats(1.0, 1500.0),
        minimum_execution_time_s=st.floats(0.0, 0.1),
    ),
)
def test_no_advice_is_what_is_set_already(
    kind: MotionKind, spacing_ms: list[int], step_rad: float, parameters: MotionParameters
) -> None:
    motion = stream(kind, step_rad, (spacing_ms * 20)[:24], parameters)
    if not motion.seconds_hand.due:
        return
    finding = seconds_hand(motion, 1)
    assert finding.figures["minimum_execution_time_low_s"] > parameters.minimum_execution_time_s  # type: ignore[operator]
    advised = number_after("set_joint_velocity_rel", " ".join(finding.remedies))
    assert 0.0 < advised < parameters.joint_velocity_rel * 1.01


def number_after(name: str, text: str) -> float:
    match = re.search(rf"{name}\(([\d.e-]+)\)", text)
    assert match is not None, text
    return float(match[1])


def test_five_in_a_row_and_not_four() -> None:
    four = stream(SMART, WAY_OF_12_MS_RAD, [21] * IN_A_ROW, FAST).seconds_hand
    assert (four.standstills, four.recognised) == (4, False)
    five = stream(SMART, WAY_OF_12_MS_RAD, [21] * (IN_A_ROW + 1), FAST).seconds_hand
    assert (five.standstills, five.recognised) == (5, True)


def test_ten_of_twenty_and_not_nine() -> None:
    # Before every second destination the arm stands: the other ones come while it moves.
    every_second = [60, 11] * WINDOW
    nine = stream(SMART, 6e-4, every_second[: 2 * MANY - 1], FAST).seconds_hand
    assert (nine.standstills, nine.recognised) == (MANY - 1, False)
    ten = stream(SMART, 6e-4, every_second[: 2 * MANY], FAST).seconds_hand
    assert (ten.standstills, ten.recognised) == (MANY, True)
    every_third = stream(SMART, 6e-4, [60, 11, 11] * WINDOW, FAST).seconds_hand
    assert every_third.standstills > MANY
    assert not every_third.recognised


@pytest.mark.parametrize("kind", KINDS)
def test_a_single_destination_and_a_rest_are_none(kind: MotionKind) -> None:
    assert stream(kind, 0.01, [1000]).seconds_hand.standstills == 0


@pytest.mark.parametrize("kind", KINDS)
def test_the_last_destination_is_none(kind: MotionKind) -> None:
    hand = stream(kind, 0.001, [10] * 10 + [2000]).seconds_hand
    assert (hand.standstills, hand.recognised) == (0, False)


@pytest.mark.parametrize("kind", KINDS)
def test_points_that_are_waited_for_are_none(kind: MotionKind) -> None:
    assert stream(kind, 0.005, [501] * 12).seconds_hand.standstills == 0
    slower = stream(kind, 0.005, [500] * 12).seconds_hand
    assert slower.standstills == 11


def test_a_rest_ends_the_stream() -> None:
    hand = stream(SMART, WAY_OF_12_MS_RAD, ([21] * 4 + [600]) * 5, FAST).seconds_hand
    assert (hand.standstills, hand.recognised) == (4 * 5, False)


@pytest.mark.parametrize("kind", KINDS)
def test_standing_on_purpose_is_none(kind: MotionKind) -> None:
    motion = KINDS[kind](MotionParameters(), basis=basis_of(), destination=None)
    run = Run(motion, at())
    there = moved(A1=0.001)
    for goal in (there, *[there] * 100, *[moved(there, A1=1e-9 * (number % 3)) for number in range(100)]):
        run.go_to(goal)
        run.cycle(21)
    assert motion.seconds_hand.standstills == 0


def test_the_same_destination_sent_often_does_not_hide_it() -> None:
    motion = SmartServo(FAST, basis=basis_of(), destination=None)
    run = Run(motion, at())
    for number in range(60):
        run.go_to(moved(A1=WAY_OF_12_MS_RAD * (number // 6 + 1)))
        run.cycle(5)
    finding = found(motion)
    assert finding.figures["application_cycle_mean_ms"] == 30.0


def test_a_velocity_that_coasts_on_is_none() -> None:
    parameters = MotionParameters(velocity_planning=True, speed_timeout_s=1.0)
    motion = SmartServo(parameters, basis=basis_of(), destination=None)
    run = Run(motion, at())
    velocity, cycles = 0.05, 50
    for number in range(20):
        # Reached early, with the velocity that leads on to the next one.
        run.go_to(moved(A1=velocity * 1e-3 * cycles * (number + 1)), (velocity, *STILL[1:]))
        run.cycle(cycles)
    assert motion.goals_reached > 5
    assert (motion.seconds_hand.standstills, motion.seconds_hand.recognised) == (0, False)


@pytest.mark.parametrize(("kind", "spacing_ms"), [(SMART, 5), (SMART, 10), (SMART, 21), (DIRECT, 5), (DIRECT, 21)])
def test_a_sine_in_good_time_is_none(kind: MotionKind, spacing_ms: int) -> None:
    time_s = 2e-3 * spacing_ms
    motion = KINDS[kind](replace(FAST, minimum_execution_time_s=time_s), basis=basis_of(), destination=None)
    run = Run(motion, at())
    for number in range(2000 // spacing_ms):
        run.go_to(moved(A1=0.1 * (1.0 - math.cos(2e-3 * math.pi * spacing_ms * number))))
        run.cycle(spacing_ms)
    assert not motion.seconds_hand.recognised
    assert motion.seconds_hand.standstills <= 2


def test_many_destinations_that_never_get_through_are_not_the_applications_fault() -> None:
    motion = stream(SMART, WAY_OF_12_MS_RAD, [21] * 12, FAST)
    motion.account.replaced_on_the_way = 60
    finding = seconds_hand(motion, 1)
    assert finding.whose is Whose.PEER_OR_WIRE
    assert "60 were replaced on the way" in finding.sentence


def test_it_is_told_at_once_then_every_few_seconds_and_at_the_end() -> None:
    hand, told = SecondsHand(), []
    for number in range(1000):
        now_ns = 21 * MS * number
        position = moved(A1=1e-3 * number)
        hand.next_destination(moved(position, A1=1e-3), now_ns, at(position), now_ns)
        hand.stands(now_ns + 12 * MS)
        if hand.due:
            told.append(now_ns)
            hand.told(now_ns)
    assert len(told) == 5
    assert all(later - earlier >= TELL_AGAIN_NS for earlier, later in itertools.pairwise(told))
    assert hand.untold
    hand.told(0)
    assert not hand.untold


@pytest.mark.parametrize(
    "limits", [AxisLimits(1.5, 3.6, 170.0), AxisLimits(0.2, 3.6, 170.0), AxisLimits(2.0, 30.0, math.inf)]
)
@pytest.mark.parametrize("way_rad", [1e-5, 1e-3, 0.05, 1.0])
def test_the_time_of_a_way_and_what_makes_it_longer(limits: AxisLimits, way_rad: float) -> None:
    time_s = way_time_s(way_rad, limits)
    assert velocity_for(way_rad, time_s, limits) <= limits.velocity
    slower = limits._replace(velocity=velocity_for(way_rad, 2 * time_s, limits))
    assert way_time_s(way_rad, slower) == pytest.approx(2 * time_s, rel=1e-3)
    weaker = limits._replace(acceleration=acceleration_for(way_rad, 2 * time_s, limits))
    assert way_time_s(way_rad, weaker) == pytest.approx(2 * time_s, rel=1e-3)
    assert way_time_s(way_for(way_rad, 2 * time_s, limits), limits) == pytest.approx(2 * time_s, rel=1e-3)


@pytest.mark.parametrize("way_rad", [1e-4, 0.01, 1.0])
def test_the_time_of_a_way_is_that_of_the_trajectory(way_rad: float) -> None:
    basis = basis_of()
    motion = SmartServo(MotionParameters(), basis=basis, destination=moved(A1=way_rad))
    run = Run(motion, at())
    cycles = run.until(lambda: motion.goals_reached == 1)
    limits = basis.limits.velocity_rad_s[0], basis.servo.acceleration_rad_s2[0], basis.servo.jerk_rad_s3[0]
    assert cycles == pytest.approx(1e3 * way_time_s(way_rad, AxisLimits(*limits)), abs=1.01)


def application_with(parameters: MotionParameters, destinations: int, *, bench: ServoBench) -> tuple[Application, int]:
    application = Application(bench)
    application.join()
    motion = application.start(SMART, None, parameters)
    set_steps(application, motion, destinations)
    return application, motion


def set_steps(application: Application, motion: int, destinations: int) -> None:
    here = application.bench.controller.motion.set_point.position_rad
    for number in range(destinations):
        application.set_destination(motion, offset(here, A1=WAY_OF_12_MS_RAD * (number + 1)))
        application.run(0.020)


def test_the_controller_tells_it_live_and_reports_it() -> None:
    bench = ServoBench(reaction=ReactionSettings())
    application, motion = application_with(FAST, 12, bench=bench)
    told = [text for text in bench.told() if "seconds hand effect" in text]
    assert len(told) == 1
    assert "what helps: give a destination more time" in told[0]
    application.ask(lambda number: SetRuntimeParameters(number, motion, minimum_execution_time_s=0.032))
    before = stood(bench)
    set_steps(application, motion, 12)
    assert stood(bench) <= before + 1, "the motion had one more destination of the old time"
    application.goodbye()
    bench.run(0.1)
    findings = bench.controller.report()["findings"]
    assert isinstance(findings, list)
    assert [(one["subject"], one["count"]) for one in findings] == [("SMART_SERVO of test", 2)]
    assert findings[0]["figures"]["standstills"] == stood(bench)


def stood(bench: ServoBench) -> int:
    [shown] = bench.controller.report()["servo"]["motions"]  # type: ignore[index]
    count: int = shown["standstills"]
    return count


def test_a_paused_program_is_none() -> None:
    bench = ServoBench()
    application, motion = application_with(replace(FAST, wait_for_pause=False), 4, bench=bench)
    before = stood(bench)
    for _ in range(8):
        bench.press(PadKey.PAUSE)
        application.run(0.05)
        bench.press(PadKey.START)
        set_steps(application, motion, 1)
    assert stood(bench) <= before + 1
    assert bench.controller.report()["findings"] == []


def test_memory_is_bounded() -> None:
    hand = SecondsHand()
    for number in range(300):
        position = moved(START, A1=1e-3 * number)
        hand.next_destination(moved(position, A1=1e-3), 20 * MS * number, SetPoint(position, STILL), 20 * MS * number)
    assert len(hand._arrivals_ns) == WINDOW + 1
    assert len(hand._standstills) == WINDOW


def test_an_override_of_nothing_is_none() -> None:
    bench = ServoBench()
    application, motion = application_with(FAST, 4, bench=bench)
    before = stood(bench)
    for _ in range(8):
        bench.controller.operate(SetOverride(0.0), now_ns=bench.now_ns)
        set_steps(application, motion, 5)
        bench.controller.operate(SetOverride(100.0), now_ns=bench.now_ns)
        set_steps(application, motion, 1)
    assert stood(bench) <= before + 4
    assert bench.controller.report()["findings"] == []
