"""The door and the sessions of the servo link: who gets in, who is told why not, who gets nothing."""

import itertools

import pytest

from hil.core.events import ApplicationJoined, ApplicationLeft, ArmStopped, PacketDropped
from hil.core.servo.link import MAX_ANSWERS
from hil.core.servo.sessions import (
    MAX_OBSERVERS,
    MAX_OFFERS,
    MAX_WAITING_REQUESTS,
    OBSERVER_STATES_A_CYCLE,
    TokenSource,
)
from hil.core.settings import ServoSettings
from hil.values.errors import ConfigurationError
from hil.values.link import Address
from hil.values.motion import MotionKind, MotionParameters
from hil.values.outcomes import Outcome
from hil.values.servo import (
    MAX_REPORTS_IN_PACKET,
    Command,
    Goodbye,
    Refused,
    RequestError,
    Role,
    SetDestination,
    StartMotion,
    Welcome,
)
from tests.support.servo_virtual import COMMANDER, OTHER, Application, ServoBench, offset
from transport.servo import ServoCodec

KEY = b"k" * 32


def moving(application: Application) -> int:
    """Start a SmartServo that is on its way."""
    start = application.bench.description.initial_position_rad
    motion = application.start(MotionKind.SMART_SERVO, offset(start, A1=1.0))
    application.run(0.5)
    assert application.bench.commanded(0)[-1] != application.bench.commanded(0)[-2]
    return motion


def test_a_hello_gets_an_offer_and_the_first_packet_begins_the_session() -> None:
    bench = ServoBench()
    application = Application(bench, name="grinder")
    answer = application.hello()
    assert isinstance(answer, Welcome)
    assert (answer.nonce, answer.software, answer.robot, answer.cycle_ms) == (
        7,
        "fri-hil test",
        "lbr-iiwa-14-r820",
        1,
    )
    bench.run(0.05)
    assert application.states == []
    assert bench.link.commander == ""
    application.command()
    bench.cycle()
    assert bench.link.commander == "grinder at 127.0.0.1:40001"
    assert [str(event) for event in bench.events if isinstance(event, ApplicationJoined)] == [
        "commander grinder at 127.0.0.1:40001 joined"
    ]
    snapshot = application.states[-1].snapshot
    assert snapshot.commander == "grinder at 127.0.0.1:40001"
    assert snapshot.measured_position == bench.description.initial_position_rad


def test_a_hello_sent_again_gets_the_same_offer() -> None:
    application = Application(ServoBench())
    first, again = application.hello(), application.hello()
    assert first == again
    application.hello_packet = application.hello_packet._replace(nonce=8)
    other = application.hello()
    assert isinstance(first, Welcome)
    assert isinstance(other, Welcome)
    assert other.token != first.token


@pytest.mark.parametrize("period_ms", [1, 4, 100])
def test_state_packets_come_in_the_period_asked_for(period_ms: int) -> None:
    bench = ServoBench()
    application = Application(bench, state_period_ms=period_ms, watchdog_ms=1000)
    application.join()
    before = len(application.states)
    bench.run(0.8)
    assert len(application.states) - before == 800 // period_ms
    cycles = [state.snapshot.cycle for state in application.states[before:]]
    assert {later - earlier for earlier, later in itertools.pairwise(cycles)} <= {period_ms}


def test_state_packets_are_numbered_and_reflect_the_application() -> None:
    application = Application(ServoBench())
    application.join()
    application.run(0.1)
    assert [state.sequence for state in application.states] == list(range(1, len(application.states) + 1))
    assert application.states[-1].reflected_sequence in {application.sequence, application.sequence - 1}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"version": 9}, "speaks version 9 of the servo link, this controller (fri-hil test) version 3: install the"),
        ({"state_period_ms": 0}, "state period 0 ms is outside 1..100 ms"),
        ({"state_period_ms": 101}, "state period 101 ms is outside 1..100 ms"),
        ({"watchdog_ms": 19}, "watchdog 19 ms is outside 20..10000 ms"),
        ({"watchdog_ms": 10_001}, "watchdog 10001 ms is outside 20..10000 ms"),
        ({"state_period_ms": 50, "watchdog_ms": 149}, "watchdog 149 ms is outside 150..10000 ms"),
        ({"latency_budget_ms": 14}, "latency budget 14 ms is outside 15..100 ms"),
        ({"latency_budget_ms": 101}, "latency budget 101 ms is outside 15..100 ms"),
    ],
)
def test_a_hello_that_cannot_be_served_is_told_why(change: dict[str, int], sentence: str) -> None:
    application = Application(ServoBench())
    application.hello_packet = application.hello_packet._replace(**change)  # type: ignore[arg-type]  # all of these are numbers
    answer = application.hello()
    assert isinstance(answer, Refused)
    assert sentence in answer.reason
    assert not answer.try_again


def test_a_state_period_that_does_not_fit_the_cycle_is_as_long_as_the_next_one_that_does() -> None:
    bench = ServoBench(cycle_ms=2)
    application = Application(bench, state_period_ms=5)
    application.join()
    before = len(application.states)
    for _ in range(30):
        bench.cycle()
    assert len(application.states) - before == 10


def test_a_second_commander_is_told_who_commands_and_gets_in_after_the_first_was_lost() -> None:
    bench = ServoBench()
    first = Application(bench, name="first")
    first.join()
    moving(first)
    second = Application(bench, address=OTHER, name="second", nonce=9)
    answer = second.hello()
    assert isinstance(answer, Refused)
    assert answer.try_again
    assert "the arm is commanded by first at 127.0.0.1:40001, heard" in answer.reason
    assert "it loses the arm after 100 ms of silence" in answer.reason
    bench.run(0.11)
    second.join()
    assert bench.link.commander == "second at 127.0.0.1:40002"
    assert first.ended[-1].reason.startswith("silent for 10")


def test_two_commanders_with_offers_only_the_first_packet_wins() -> None:
    bench = ServoBench()
    first, second = Application(bench), Application(bench, address=OTHER)
    assert isinstance(first.hello(), Welcome)
    assert isinstance(second.hello(), Welcome)
    first.command()
    second.command()
    bench.cycle()
    assert bench.link.commander.endswith(":40001")
    assert bench.dropped(Outcome.CROWDED) == 1
    assert second.states == []


def test_a_silent_commander_loses_the_arm_within_its_watchdog() -> None:
    bench = ServoBench()
    application = Application(bench, watchdog_ms=50)
    application.join()
    moving(application)
    heard_ns = bench.now_ns
    bench.run(1.0)
    [stop] = [event for event in bench.events if isinstance(event, ArmStopped)]
    assert 50_000_000 <= stop.at_ns - heard_ns <= 52_000_000
    assert stop.reason == (
        "the application left: silent for 51 ms, the watchdog allows 50 ms (1.0 ms too long); packet 502 was its last"
    )
    assert bench.controller.motion.at_rest
    assert bench.commanded(0)[-1] == bench.commanded(0)[-50]
    assert bench.link.commander == ""
    [left] = [event for event in bench.events if isinstance(event, ApplicationLeft)]
    assert left.reason == "silent for 51 ms, the watchdog allows 50 ms (1.0 ms too long); packet 502 was its last"


def test_a_stall_of_our_own_is_not_charged_to_the_commander() -> None:
    bench = ServoBench()
    application = Application(bench, watchdog_ms=50)
    application.join()
    for _ in range(40):
        bench.now_ns += 60_000_000
        application.command()
        bench.cycle(lateness_ns=0)
    assert bench.link.commander != ""


def test_a_restarted_application_gets_in_again_and_finds_no_motion() -> None:
    bench = ServoBench()
    crashed = Application(bench, watchdog_ms=40)
    crashed.join()
    moving(crashed)
    restarted = Application(bench, address=OTHER, nonce=11)
    for _ in range(100):
        if isinstance(restarted.hello(), Welcome):
            break
    restarted.command()
    bench.cycle()
    assert bench.link.commander.endswith(":40002")
    restarted.run(1.0)
    assert restarted.states[-1].snapshot.motions == ()
    assert restarted.start(MotionKind.SMART_SERVO) == 1


def test_goodbye_brakes_the_arm_and_frees_the_seat_at_once() -> None:
    bench = ServoBench()
    application = Application(bench)
    application.join()
    moving(application)
    application.goodbye()
    bench.cycle()
    assert bench.link.commander == ""
    other = Application(bench, address=OTHER, nonce=3)
    other.join()
    other.run(1.0)
    assert bench.controller.motion.at_rest
    assert [stop.reason for stop in bench.controller.stops] == ["the application left: it said goodbye"]


def test_any_number_of_observers_watch_and_none_commands() -> None:
    bench = ServoBench()
    application = Application(bench)
    application.join()
    observers = [
        Application(bench, address=Address("127.0.0.1", 41000 + index), role=Role.OBSERVER, watchdog_ms=5000)
        for index in range(MAX_OBSERVERS)
    ]
    for observer in observers:
        observer.join()
        application.command()
    late = Application(bench, address=OTHER, role=Role.OBSERVER).hello()
    assert isinstance(late, Refused)
    assert late.reason == f"{MAX_OBSERVERS} observers watch already, no more are served"
    observers[0].command(StartMotion(1, MotionKind.SMART_SERVO, MotionParameters(), None))
    application.run(0.05)
    [done] = observers[0].done
    assert done.error is RequestError.ILLEGAL_STATE
    assert done.reason == "an observer may watch, not command; connect as commander"
    motion = application.start(MotionKind.SMART_SERVO)
    application.run(0.05)
    assert [seen.motion for seen in observers[5].states[-1].snapshot.motions] == [motion]
    assert bench.link.report()["observers"] == MAX_OBSERVERS


def test_many_observers_take_turns_and_cost_a_cycle_no_more_than_a_few() -> None:
    bench = ServoBench()
    application = Application(bench, state_period_ms=1)
    application.join()
    observers = [
        Application(
            bench, address=Address("127.0.0.1", 41000 + index), role=Role.OBSERVER, watchdog_ms=5000, state_period_ms=1
        )
        for index in range(40)
    ]
    for observer in observers:
        observer.join()
        application.command()
    before = {observer.address: len(observer.states) for observer in observers}
    for _ in range(100):
        sent = bench.link.counters.sent
        application.command()
        bench.cycle()
        assert bench.link.counters.sent - sent == 1 + OBSERVER_STATES_A_CYCLE
    shares = {len(observer.states) - before[observer.address] for observer in observers}
    assert shares == {100 * OBSERVER_STATES_A_CYCLE // len(observers)}


def test_an_observer_that_leaves_or_falls_silent_disturbs_nobody() -> None:
    bench = ServoBench()
    application = Application(bench)
    application.join()
    moving(application)
    quiet = Application(bench, address=OTHER, role=Role.OBSERVER)
    quiet.join()
    polite = Application(bench, address=Address("127.0.0.1", 40003), role=Role.OBSERVER)
    polite.join()
    polite.goodbye()
    application.run(0.3)
    assert bench.link.report()["observers"] == 0
    assert quiet.ended[-1].reason.startswith("silent for")
    assert bench.controller.stops == type(bench.controller.stops)()


def test_strangers_get_nothing_and_are_counted() -> None:
    bench = ServoBench()
    application = Application(bench)
    application.join()
    bench.deliver(Command(application.token, 10**6, 0), OTHER)
    bench.deliver(Command(12345, 1, 0), OTHER)
    bench.deliver(Goodbye(application.token, 10**6), OTHER)
    bench.deliver(b"", OTHER)
    bench.deliver(b"\x00" * 30, OTHER)
    bench.deliver(b"\xff" * 2000, OTHER)
    bench.cycle()
    assert bench.sent[OTHER] == []
    assert bench.dropped(Outcome.UNKNOWN_SESSION) == 3
    assert bench.dropped(Outcome.TOO_LONG) == 1
    assert bench.link.commander != ""


def test_an_old_session_cannot_be_replayed() -> None:
    bench = ServoBench()
    application = Application(bench, watchdog_ms=30)
    application.join()
    old_token = application.token
    bench.run(0.1)
    assert bench.link.commander == ""
    bench.deliver(
        Command(old_token, 10**6, 0, requests=(StartMotion(99, MotionKind.PTP, MotionParameters(), ()),)), COMMANDER
    )
    bench.cycle()
    assert bench.link.commander == ""
    assert bench.dropped(Outcome.UNKNOWN_SESSION) == 1


def test_duplicates_and_overtaken_packets_are_counted_and_change_nothing() -> None:
    bench = ServoBench()
    application = Application(bench)
    application.join()
    start = StartMotion(1, MotionKind.SMART_SERVO, MotionParameters(), None)
    old = Command(application.token, application.sequence + 1, 0, requests=(start,))
    application.sequence += 1
    application.command(start)
    bench.deliver(old, COMMANDER)
    bench.deliver(old._replace(sequence=application.sequence), COMMANDER)
    bench.cycle()
    assert bench.dropped(Outcome.REORDERED) == 1
    assert bench.dropped(Outcome.DUPLICATE) == 1
    assert [motion.motion for motion in application.states[-1].snapshot.motions] == [1]
    assert bench.link.requests_taken == 1


def test_reports_are_told_again_until_they_were_seen() -> None:
    bench = ServoBench()
    application = Application(bench)
    application.join()
    application.number = 1
    for _ in range(3):
        application.command(StartMotion(1, MotionKind.SMART_SERVO, MotionParameters(), None), reports_seen=0)
        application.bench.cycle()
        assert [report.number for report in application.states[-1].reports] == [1]
    application.command(wants_state=True, reports_seen=1)
    bench.cycle()
    assert application.states[-1].reports == ()


def test_more_reports_than_fit_a_packet_come_one_after_the_other() -> None:
    bench = ServoBench()
    application = Application(bench)
    application.join()
    motion = application.start(MotionKind.SMART_SERVO)
    start = bench.description.initial_position_rad
    numbers = range(2, 2 + 2 * MAX_REPORTS_IN_PACKET)
    for number in numbers:
        application.command(SetDestination(number, motion, start), reports_seen=1)
    bench.cycle()
    assert len(application.states[-1].reports) == MAX_REPORTS_IN_PACKET
    application.run(0.05)
    assert [done.request for done in application.done] == [1, *numbers]


def test_too_many_requests_at_once_wait_for_the_next_packet() -> None:
    bench = ServoBench()
    application = Application(bench)
    application.join()
    motion = application.start(MotionKind.SMART_SERVO)
    start = bench.description.initial_position_rad
    for number in range(2, 2 + MAX_WAITING_REQUESTS):
        application.command(SetDestination(number, motion, start))
    application.command(SetDestination(2 + MAX_WAITING_REQUESTS, motion, start))
    bench.cycle()
    assert bench.dropped(Outcome.CROWDED) == 1
    application.command(SetDestination(2 + MAX_WAITING_REQUESTS, motion, start))
    bench.cycle()
    assert application.states[-1].requests_done == 2 + MAX_WAITING_REQUESTS


def test_a_flood_of_hellos_is_bounded_and_the_commander_does_not_notice() -> None:
    bench = ServoBench()
    application = Application(bench)
    application.join()
    moving(application)
    flood = application.hello_packet._replace(role=Role.OBSERVER)
    for index in range(3 * MAX_OFFERS):
        bench.deliver(flood._replace(nonce=1000 + index), Address("127.0.0.9", 1024 + index))
    before = len(bench.sent)
    application.command()
    bench.cycle()
    assert len(bench.sent) - before <= MAX_ANSWERS
    assert bench.dropped(Outcome.CROWDED) == 3 * MAX_OFFERS - MAX_ANSWERS
    application.run(0.2)
    assert bench.link.commander != ""
    assert list(bench.controller.stops) == []


def test_with_a_key_only_tagged_packets_are_heard() -> None:
    bench = ServoBench(key=KEY)
    application = Application(bench)
    for codec in (ServoCodec(), ServoCodec(b"x" * 32)):
        bench.deliver(codec.encode_from_client(application.hello_packet), COMMANDER)
    bench.cycle()
    assert bench.sent[COMMANDER] == []
    assert bench.dropped(Outcome.UNAUTHENTICATED) == 2
    application.join()
    forged = ServoCodec().encode_from_client(Command(application.token, 10**9, 0))
    bench.deliver(forged, COMMANDER)
    application.run(0.3)
    assert bench.link.commander != ""
    assert bench.dropped(Outcome.UNAUTHENTICATED) == 3


def test_shutdown_tells_every_session_and_lets_nobody_in() -> None:
    bench = ServoBench()
    application = Application(bench)
    application.join()
    moving(application)
    bench.controller.close(now_ns=bench.now_ns)
    refused = Application(bench, address=OTHER).hello()
    assert isinstance(refused, Refused)
    assert refused.reason == "the controller shuts down"
    application.run_until(lambda: bench.controller.closed, at_most_s=3)
    assert application.ended[-1].reason == "the controller shuts down"
    assert application.ends[-1].reason == "the controller shuts down"


def test_tokens_differ_and_depend_on_the_secret() -> None:
    tokens, again, others = TokenSource(b"a"), TokenSource(b"a"), TokenSource(b"b")
    made = [tokens.next() for _ in range(1000)]
    assert len(set(made)) == 1000
    assert made == [again.next() for _ in range(1000)]
    assert not set(made) & {others.next() for _ in range(1000)}
    with pytest.raises(ConfigurationError, match=r"a token secret of 0 bytes; 1\.\.64 are needed"):
        ServoSettings(software="", robot="", token_secret=b"")


def test_a_packet_older_than_its_budget_is_late() -> None:
    bench = ServoBench()
    application = Application(bench, watchdog_ms=200, state_period_ms=5)
    application.hello_packet = application.hello_packet._replace(latency_budget_ms=30)
    application.join()
    application.run(0.1)
    reflected = application.states[-1].sequence
    bench.run(0.030)

    def say() -> None:
        application.sequence += 1
        bench.deliver(Command(application.token, application.sequence, reflected, 0), application.address)

    say()
    assert bench.dropped(Outcome.LATE) == 0
    bench.run(0.010)
    say()
    bench.run(0.001)
    assert bench.dropped(Outcome.LATE) == 1
    [told] = [event.detail for event in bench.events if isinstance(event, PacketDropped)]
    assert told == (
        f"packet {application.sequence} of test at 127.0.0.1:40001 reflects state {reflected}, and the one after that "
        "was sent 35.0 ms ago, 5.0 ms over the latency budget of 30 ms"
    )
    for _ in range(250):
        say()
        bench.cycle()
    assert bench.link.commander == "", "late packets are no sign of life"
    [left] = [event for event in bench.events if isinstance(event, ApplicationLeft)]
    assert "packets came, but late: reflects state" in left.reason


def test_a_state_nobody_sent_is_late_and_a_stall_of_ours_is_not_charged() -> None:
    bench = ServoBench()
    application = Application(bench, watchdog_ms=200)
    application.hello_packet = application.hello_packet._replace(latency_budget_ms=20)
    application.join()
    application.run(0.05)
    bench.now_ns += 100_000_000
    application.command()
    assert bench.dropped(Outcome.LATE) == 0, "there is no newer state than the one it reflects"
    application.sequence += 1
    bench.deliver(Command(application.token, application.sequence, 10_000, 0), application.address)
    assert bench.dropped(Outcome.LATE) == 1
