"""Set-point accounting: no destination is lost from the books, however many are lost on the way."""

from functools import partial
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.client.servo._set_point_accounting import accounting_of
from hil.client.servo.statistic_timer import StatisticTimer
from hil.core.motion.destination_account import DestinationAccount, Spacing
from hil.core.servo.set_points import REMEMBERED_MOTIONS
from hil.core.settings import ReactionSettings
from hil.values.motion import FineInterpolatorState, MotionKind, MotionParameters, MotionPhase
from hil.values.servo import MotionState, SetDestination, StartMotion
from tests.support.cases import cases
from tests.support.servo_virtual import Application, ServoBench, offset
from tests.unit.test_servo_lossy import Pair

SERVO_KINDS = [MotionKind.SMART_SERVO, MotionKind.DIRECT_SERVO]
FAST = MotionParameters(acceleration_override=20.0, joint_jerk_percent=500.0)


def motions(bench: ServoBench) -> list[dict[str, Any]]:
    servo: Any = bench.controller.report()["servo"]
    reported: list[dict[str, Any]] = servo["motions"]
    return reported


def assert_adds_up(motion: dict[str, Any]) -> None:
    assert motion["sent"] == motion["received"] + motion["replaced_on_the_way"]
    assert motion["received"] == motion["accepted"] + motion["refused"]
    assert motion["accepted"] == motion["executed"] + motion["superseded"] + motion["waiting"]
    assert all(motion[what] >= 0 for what in ("replaced_on_the_way", "refused", "superseded", "executed", "waiting"))


def joined(**options: object) -> Application:
    application = Application(ServoBench(**options))  # type: ignore[arg-type]
    application.join()
    return application


@settings(max_examples=cases(12), deadline=None)
@given(
    seed=st.integers(0, 10_000),
    loss=st.sampled_from([0.0, 0.3, 0.7]),
    kind=st.sampled_from(SERVO_KINDS),
    every=st.integers(1, 4),
    last=st.sampled_from(["rests", "refused"]),
)
def test_every_destination_that_was_set_is_in_the_books(
    seed: int, loss: float, kind: MotionKind, every: int, last: str
) -> None:
    pair = Pair(seed, loss=loss, repeat=loss / 2, latest_ms=0.2 + 8.0 * loss)
    session, start = pair.session, pair.bench.description.initial_position_rad
    pair.run_until(lambda: session.running)
    begun = session.ask(lambda number: StartMotion(number, kind, FAST, start))
    pair.run_until(lambda: begun.done is not None)
    motion = begun.request.number
    record = session.motions[motion]
    for index in range(60):
        session.ask(partial(SetDestination, motion=motion, position=offset(start, A1=1e-4 * index)))
        for _ in range(every):
            pair.cycle()
        assert_adds_up(motions(pair.bench)[0])
    if last == "refused":
        session.ask(partial(SetDestination, motion=motion, position=(0.0,) * 6))
        pair.run_until(lambda: record.ended is not None)
    pair.run_until(lambda: not session.requests)
    for _ in range(30):
        pair.cycle()
    [shown] = motions(pair.bench)
    assert_adds_up(shown)
    assert shown["sent"] == record.sent == 61 + (last == "refused")
    assert shown["refused"] == (last == "refused")
    assert shown["replaced_on_the_way"] <= session.requests.superseded
    if last == "rests":
        assert shown["waiting"] == 0
    assert shown["age_us"]["max"] is None or shown["age_us"]["max"] <= 10_000


@pytest.mark.parametrize(
    ("kind", "age_ms", "waiting"), [(MotionKind.SMART_SERVO, 20.0, 3), (MotionKind.DIRECT_SERVO, 12.0, 2)]
)
def test_ages_rate_and_spacing_are_those_of_the_stream(kind: MotionKind, age_ms: float, waiting: int) -> None:
    application = joined(reaction=ReactionSettings())
    start = application.bench.description.initial_position_rad
    motion = application.start(kind, None, FAST)
    for index in range(20):
        application.set_destination(motion, offset(start, A1=1e-3 * index))
        application.run(0.004)
    [shown] = motions(application.bench)
    assert shown["waiting"] == waiting
    assert shown["end"] == ""
    application.run(0.03)
    application.stop(motion)
    [shown] = motions(application.bench)
    assert (shown["executed"], shown["waiting"], shown["superseded"]) == (20, 0, 0)
    assert shown["age_us"]["p50"] == pytest.approx(1e3 * age_ms, rel=0.06)
    assert shown["executed_per_s"] == pytest.approx(200.0, rel=0.01)
    assert shown["arrival_spacing"] == "n(19) T(5.00, 5.00, 5.00 msec) (stdDev 0.00)"
    assert shown["end"] == "STOPPED: stopped by the application"
    assert shown["ended_s"] > shown["began_s"]


def test_a_rest_does_not_lower_the_effective_rate() -> None:
    application = joined()
    start = application.bench.description.initial_position_rad
    motion = application.start(MotionKind.SMART_SERVO, None, FAST)
    for burst in range(3):
        for index in range(10):
            application.set_destination(motion, offset(start, A1=1e-3 * (10 * burst + index)))
            application.run(0.009)
        application.run(0.8)
    assert motions(application.bench)[0]["executed_per_s"] == pytest.approx(100.0)


def test_what_waits_when_the_motion_ends_and_what_comes_after_it() -> None:
    application = joined(reaction=ReactionSettings())
    start = application.bench.description.initial_position_rad
    motion = application.start(MotionKind.SMART_SERVO, start)
    application.run(0.05)
    for index in range(3):
        application.set_destination(motion, offset(start, A1=1e-3 * index))
    application.stop(motion)
    application.set_destination(motion, start)
    [shown] = motions(application.bench)
    assert_adds_up(shown)
    assert (shown["received"], shown["executed"], shown["waiting"], shown["refused"]) == (5, 1, 3, 1)


def test_numbers_that_never_came_were_replaced_on_the_way() -> None:
    application = joined()
    start = application.bench.description.initial_position_rad
    motion = application.start(MotionKind.SMART_SERVO)
    for _ in range(10):
        application.number += 4
        application.set_destination(motion, start)
    [shown] = motions(application.bench)
    assert (shown["sent"], shown["replaced_on_the_way"], shown["received"]) == (50, 40, 10)


def test_a_ptp_has_no_account_and_the_last_servo_motions_are_remembered() -> None:
    application = joined()
    start = application.bench.description.initial_position_rad
    application.start(MotionKind.PTP, start)
    application.run(0.01)
    assert motions(application.bench) == []
    for _ in range(REMEMBERED_MOTIONS + 3):
        application.stop(application.start(MotionKind.DIRECT_SERVO))
    shown = motions(application.bench)
    assert len(shown) == REMEMBERED_MOTIONS
    assert [motion["motion"] for motion in shown] == sorted(motion["motion"] for motion in shown)


@given(st.lists(st.integers(0, 10**10), max_size=50))
def test_the_spacing_is_the_statistic_of_the_manual(times_ns: list[int]) -> None:
    spacing, timer = Spacing(), StatisticTimer()
    at_ns = 10**15
    spacing.event(at_ns)
    for time_ns in times_ns:
        at_ns += time_ns
        spacing.event(at_ns)
        timer.add(time_ns / 1e6)
    assert spacing.mean_ns / 1e6 == pytest.approx(timer.mean_ms)
    assert spacing.standard_deviation_ns / 1e6 == pytest.approx(timer.standard_deviation_ms, abs=1e-6)
    assert (spacing.shortest_ns / 1e6, spacing.longest_ns / 1e6) == (timer.min_ms, timer.max_ms)
    assert str(Spacing()) == str(StatisticTimer())


def test_an_account_of_nothing_has_no_rate() -> None:
    account = DestinationAccount()
    assert account.executed_per_s(executed=0, executed_at_ns=0) is None
    account.stream_begins(5)
    assert account.executed_per_s(executed=1, executed_at_ns=5) is None


def test_what_an_application_sees_of_it() -> None:
    shown = MotionState(
        1, MotionKind.SMART_SERVO, MotionPhase.ACTIVE, FineInterpolatorState.MOVING, (), 3_000_000, 0.0, 0,
        received=9, superseded=3, executed=6, executed_at_ns=25_500_000,
    )  # fmt: skip
    assert str(accounting_of(shown, sent=12)) == (
        "destinations sent 12, received 9, superseded 3, waiting 0, executed 6; the last one 22.5 ms after it arrived"
    )
    waiting = accounting_of(shown._replace(received=10), sent=12)
    assert (waiting.waiting, waiting.age_ms) == (1, None)
