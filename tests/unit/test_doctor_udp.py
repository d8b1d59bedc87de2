"""What the times and numbers of a link say: each fault is made in virtual time, and the sentence is read."""

import random
import re
from collections.abc import Callable

import pytest

from hil.values.finding import Diagnosis, Severity, Whose
from hil.values.fri import Release
from tests.support.timed_link import CONTROLLER, MS, US, TimedLink, diagnosed, measured, wire
from tools.doctor.udp.figures import LinkFigures
from tools.doctor.udp.floor import floor_under
from tools.doctor.udp.fri import fri_figures
from tools.doctor.udp.tally import MOST_MISSING, FriTally, States
from tools.doctor.udp.verdict import judge

NEVER = 10**9


def every(
    number: int, of: int, value: int | None, otherwise: Callable[[int], int] = wire
) -> Callable[[int], int | None]:
    """Let each ``number``-th of ``of`` have another value."""
    return lambda place: value if place % of == number else otherwise(place)


def test_a_healthy_link_is_measured_exactly_and_the_cycle_s_wait_is_no_network() -> None:
    found = measured(TimedLink(), seconds=0.5)
    assert (found.states_lost, found.requests_lost, found.dropped_here) == (0, 0, 0)
    assert found.answered == found.requests_sent >= 99
    # 50 us each way, and a cycle that begins 20 us late; 1.6 % is what a histogram may be off.
    assert found.network.quantile(0.5) == pytest.approx(120 * US, rel=0.02)
    # Requests are spread over the cycle: so is what they wait for it.
    assert found.cycle_wait.quantile(0.5) == pytest.approx(0.5 * MS, rel=0.1)
    assert 0.95 * MS < found.cycle_wait.maximum <= MS
    assert found.drift_ppm == pytest.approx(0, abs=0.1)
    diagnosis = judge(found, controller=CONTROLLER, same_machine=False)
    assert diagnosis.healthy
    assert diagnosis.verdict.whose is Whose.NOBODY
    assert diagnosis.verdict.sentence == (
        f"nothing wrong between this host and 192.0.2.1:30300: none of {found.states_sent} states and "
        f"{found.requests_sent} requests was lost; round trip 0.12 ms (p99 0.12 ms) beside the wait for the "
        "controller's cycle of 1 ms; jitter p99 0.00 ms of a period of 5 ms"
    )


def test_the_controller_does_not_notice_who_watches() -> None:
    link = TimedLink()
    measured(link, seconds=0.1)
    link.receive(0.01)
    report = link.bench.link.report()
    assert (report["commander"], report["observers"], report["requests_refused"]) == ("", 0, 0)


def test_five_milliseconds_are_six_where_the_cycle_is_two() -> None:
    assert measured(TimedLink(cycle_ms=2), seconds=0.1).period_ns == 6 * MS


@pytest.mark.parametrize("drift", [150e-6, -40e-6])
def test_the_drift_of_the_clocks_is_seen_through_jitter(drift: float) -> None:
    dice = random.Random(3)
    link = TimedLink(drift=drift, down=lambda _: 50 * US + round(dice.expovariate(1 / (20 * US))))
    found = measured(link, seconds=0.6)
    assert found.drift_ppm == pytest.approx(-1e6 * drift, abs=5)
    sentences = [one.sentence for one in judge(found, controller=CONTROLLER, same_machine=False).findings]
    assert any("ppm fast against this host's" in one for one in sentences) == (drift > 100e-6), sentences


def lost_down() -> Diagnosis:
    return diagnosed(TimedLink(down=every(3, 10, None)), seconds=0.5)


def lost_up() -> Diagnosis:
    return diagnosed(TimedLink(up=every(3, 20, None)), seconds=0.5)


def lost_on_this_machine() -> Diagnosis:
    return diagnosed(TimedLink(down=every(3, 10, None)), seconds=0.5, same_machine=True)


def reads_late() -> Diagnosis:
    return diagnosed(TimedLink(read_late=lambda n: 8 * MS if n % 20 == 19 else 20 * US), seconds=0.5)


def controller_late() -> Diagnosis:
    return diagnosed(TimedLink(cycle_late=lambda n: 8 * MS if n % 100 == 50 else 20 * US), seconds=0.5)


def jitter_up() -> Diagnosis:
    return diagnosed(TimedLink(up=lambda n: n * 7919 % 20 * MS), seconds=0.5)


def jitter_down() -> Diagnosis:
    return diagnosed(TimedLink(down=lambda n: n * 7919 % 20 * MS), seconds=0.5)


def jitter_both() -> Diagnosis:
    return diagnosed(TimedLink(up=lambda n: n * 7919 % 20 * MS, down=lambda n: n * 7919 % 20 * MS), seconds=0.5)


def falls_silent() -> Diagnosis:
    return diagnosed(TimedLink(down=lambda n: wire(n) if n < 100 else None), seconds=20)


def is_heard_no_more() -> Diagnosis:
    return diagnosed(TimedLink(up=lambda n: wire(n) if n < 100 else None), seconds=20)


@pytest.mark.parametrize(
    ("made", "kind", "whose", "sentence"),
    [
        (
            lost_down,
            "link-loss",
            Whose.WIRE,
            (
                r"packets are lost: \d+\.\d % of what the controller sent was lost "
                r"\(\d\d of \d+ states\), 0 % of what this host sent \(0 of \d+ requests\); the network between, not "
                r"this host \(its socket dropped none\) and not the controller's timing"
            ),
        ),
        (
            lost_up,
            "link-loss",
            Whose.WIRE,
            (
                r"packets are lost: 0 % of what the controller sent was lost .* "
                r"(4\.\d|5|5\.\d) % of what this host sent \(\d of \d+ requests\)"
            ),
        ),
        (
            lost_on_this_machine,
            "link-loss",
            Whose.WIRE,
            (
                r"both ends are on this machine, so what stands between them "
                r"loses them \(hil impair"
            ),
        ),
        (
            reads_late,
            "receive-late",
            Whose.HOST,
            (
                r"this host reads late: states waited p99 8\.\d\d ms in its kernel for "
                r"the program \(median 0\.02 ms, max \d\.\d\d ms\), and they come every 5 ms"
            ),
        ),
        (
            controller_late,
            "controller-late",
            Whose.CONTROLLER,
            (
                r"the controller runs late: \d+ of \d+ answers left in a "
                r"cycle that began a whole cycle or more after it was due, the worst \d\.\d\d ms late at least"
            ),
        ),
        (
            jitter_up,
            "jitter",
            Whose.WIRE,
            (
                r"jitter is larger than the period: p99 0\.\d\d ms to this host, 1\d\.\d\d ms "
                r"to the controller, in a period of 5 ms: the network, towards the controller; what arrives there is "
                "stamped by its kernel"
            ),
        ),
        (
            jitter_down,
            "jitter",
            Whose.PEER_OR_WIRE,
            (
                r"p99 1\d\.\d\d ms to this host, 0\.\d\d ms to the controller, in a "
                "period of 5 ms: the controller, or the network towards this host"
            ),
        ),
        (jitter_both, "jitter", Whose.WIRE, "the network, both ways"),
        (
            falls_silent,
            "link-ended",
            Whose.PEER_OR_WIRE,
            (
                r"the session ended after 0\.4 s: nothing came any more for "
                r"1\.5 s; until then none of 99 states and 87 requests was lost"
            ),
        ),
        (
            is_heard_no_more,
            "link-ended",
            Whose.PEER_OR_WIRE,
            (
                r"the controller ended the session: silent for 2001 ms, the "
                "watchdog allows 2000 ms"
            ),
        ),
    ],
)
def test_a_fault_is_named_with_its_side_and_its_figures(
    made: Callable[[], Diagnosis], kind: str, whose: Whose, sentence: str
) -> None:
    diagnosis = made()
    verdict = diagnosis.verdict
    assert (verdict.kind, verdict.whose) == (kind, whose), [str(one) for one in diagnosis.findings]
    assert re.search(sentence, verdict.sentence), verdict.sentence
    assert verdict.remedies
    assert verdict.severity in {Severity.WARNING, Severity.FAULT}
    assert not diagnosis.healthy


def test_what_this_host_s_socket_dropped_is_not_the_network_s() -> None:
    link = TimedLink(down=every(3, 10, None))
    link.dropped = NEVER
    diagnosis = diagnosed(link, seconds=0.3)
    assert diagnosis.verdict.kind == "receive-buffer"
    assert diagnosis.verdict.whose is Whose.HOST
    assert "states arrived and were dropped, because the buffer of the socket was full" in diagnosis.verdict.sentence
    assert all(one.kind != "link-loss" for one in diagnosis.findings)


def test_where_the_system_does_not_tell_what_it_drops_the_sentence_says_so() -> None:
    link = TimedLink(down=every(3, 10, None))
    link.dropped = None
    assert "unless its socket dropped them, which is not known here" in diagnosed(link, seconds=0.2).verdict.sentence


def test_a_late_answer_hides_no_loss_and_makes_none() -> None:
    # Round trips of 60 ms, and a third of all packets gone, both ways: only two requests are ever on the way.
    dice = random.Random(5)

    def bad(_: int) -> int | None:
        return None if dice.random() < 0.3 else 30 * MS

    sent: list[int] = []
    arrived: list[int] = []

    def up(number: int) -> int | None:
        delay = bad(number)
        sent.append(number)
        if delay is not None:
            arrived.append(number)
        return delay

    found = measured(TimedLink(up=up, down=bad), seconds=1.5)
    assert found.answered + found.requests_lost == found.requests_sent > 10
    assert found.requests_lost == pytest.approx(0.3 * found.requests_sent, abs=0.25 * found.requests_sent)
    assert found.down_lost_share == pytest.approx(0.3, abs=0.08)
    assert found.network.quantile(0.5) == pytest.approx(60 * MS, rel=0.05)


def test_too_little_is_no_verdict() -> None:
    found = LinkFigures(5 * MS, MS, answered=2, requests_sent=2, states_sent=3)
    verdict = judge(found, controller=CONTROLLER, same_machine=False).verdict
    assert (verdict.kind, verdict.sentence) == (
        "too-little",
        "only 2 of 2 requests were answered in 0.0 s: too little for a verdict",
    )


def test_states_are_counted_by_their_numbers() -> None:
    states = States()
    assert [states.book(number) for number in (5, 6, 8, 7, 8, 7, 11)] == [True, True, True, True, False, False, True]
    assert (states.sent, states.received, states.lost) == (7, 5, 2)
    assert (states.reordered, states.duplicates) == (1, 2)
    # A number that leaps is no reason to remember all between.
    assert states.book(10**15)
    assert len(states._missing) == MOST_MISSING
    assert not states.book(12)


def fri_tally(
    *, lost: int = NEVER, overtaken: int = NEVER, unheard: int = NEVER, first: int = 2**32 - 5, stamps: bool = True
) -> FriTally:
    """Return what thirty messages 5 ms apart and their answers come to; the counter runs over."""
    tally = FriTally()
    taken = 0
    for place in range(30):
        at_ns = place * 5 * MS
        if place != unheard:
            # After a stall two messages come at once: the answers to them are there at once too.
            arrived_ns = at_ns + (5 * MS if place == overtaken else 0)
            tally.heard(
                (first + place) % 2**32, reflected=taken, period_ns=5 * MS, stamp_ns=stamps * (10**18 + at_ns),
                arrived_ns=arrived_ns + 100 * US, waited_ns=30 * US,
            )  # fmt: skip
            tally.answered(place + 1, sent_ns=arrived_ns + 200 * US)
            if place not in {lost, overtaken}:
                taken = place + 1
    return tally


def test_answers_that_were_not_taken_are_lost_or_overtaken_or_not_known() -> None:
    clean = fri_tally()
    assert (clean.states.sent, clean.states.lost, clean.lost, clean.overtaken, clean.confirmed) == (30, 0, 0, 0, 29)
    assert clean.confirmed_after.maximum == 4_900_000
    found = fri_tally(lost=7)
    assert (found.lost, found.overtaken, found.confirmed) == (1, 0, 28)
    found = fri_tally(overtaken=7)
    assert (found.lost, found.overtaken, found.confirmed) == (0, 1, 28)
    found = fri_tally(unheard=9, lost=8)
    assert (found.states.lost, found.lost, found.overtaken) == (1, 1, 0)


@pytest.mark.parametrize("stamps", [True, False])
def test_a_lost_answer_of_the_fri_link_is_the_verdict(stamps: bool) -> None:
    found = fri_figures(fri_tally(lost=7, stamps=stamps), None, Release.V1_15)
    found.period_ns = 5 * MS
    diagnosis = judge(found, controller=CONTROLLER, same_machine=False)
    assert diagnosis.verdict.sentence.startswith(
        "packets are lost: 0 % of what the controller sent was lost (0 of 30 messages), 3.4 % of what this host sent "
        "(1 of 29 answers)"
    )


def test_the_floor_is_under_every_delay_and_has_the_drift() -> None:
    dice = random.Random(7)
    at_ns = sorted(dice.randrange(10**10) for _ in range(2000))
    delays_ns = [5 * MS - at // 20_000 + round(dice.expovariate(1 / MS)) for at in at_ns]
    floor = floor_under(at_ns, delays_ns)
    excess = [floor.excess_ns(at, delay) for at, delay in zip(at_ns, delays_ns, strict=True)]
    assert min(excess) >= -1
    assert floor.slope * 1e6 == pytest.approx(-50, abs=1)
    assert floor_under([], []).delay_ns(5) == 0
    assert floor_under([3, 3], [9, 7]).delay_ns(5) == 7


def test_figures_are_there_for_programs() -> None:
    figures = diagnosed(TimedLink(), seconds=0.2).as_dict()["findings"][0]["figures"]  # type: ignore[index]
    assert figures["states_lost"] == figures["requests_lost"] == 0
    assert figures["network_p50_ms"] == pytest.approx(0.12, rel=0.02)
    assert {"round_trip_p99_ms", "jitter_down_p99_ms", "jitter_up_p99_ms", "waited_here_max_ms"} <= set(figures)
