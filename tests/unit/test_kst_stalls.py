"""Stalls of a KST connection told from hand-written timelines; each has a near miss that has to stay silent."""

import json
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.kst.spread import Spread
from hil.kst.stall_findings import SEVERAL, Seen, Waits, findings_of
from hil.kst.stalls import SAMPLE_UNTIL_NS, StallWatch
from hil.values.finding import Severity, Whose
from tests.support.kst_line import MS, REQUEST, Line, asks_in_parts, ping_pong
from transport.tcp.sockets import Kernel


def test_a_request_in_two_parts_one_delayed_acknowledgement_apart_is_the_clients_nagle() -> None:
    line = asks_in_parts(Line())
    assert line.kinds() == ["kst-request-in-parts"]
    (found,) = line.watch.findings()
    assert (found.severity, found.whose) == (Severity.FAULT, Whose.PEER)
    assert found.sentence.startswith("the client has to set TCP_NODELAY or to write a request in one piece: 12 of 12")
    assert "44.0 ms after the beginning" in found.sentence or "43.9 ms after the beginning" in found.sentence
    assert found.sentence.endswith("at most 23 requests a second")
    assert found.figures["count"] == 12
    assert "as Linux does (40 ms)" in found.evidence[0]
    assert "TCP_NODELAY" in found.remedies[0]


def test_one_or_two_are_not_told() -> None:
    line = asks_in_parts(Line(), count=SEVERAL - 1)
    assert line.stalls("request in parts") == SEVERAL - 1
    assert line.kinds() == []


def test_a_program_that_pauses_40_ms_within_a_request_with_no_delay_set_is_not_held() -> None:
    """The rest comes before this side's acknowledgement has left: nothing waited for it."""
    line = Line()
    for _ in range(20):
        line.wait(1.0)
        line.reads(REQUEST, is_open=True)
        line.wait(40.0)
        line.acknowledge()
        line.reads(1, lines=1, due=1)
        line.writes()
    assert line.kinds() == []
    assert line.none("request in parts") == {"own pace": 20}


@pytest.mark.parametrize("pause_ms", [3.0, 8.0])
def test_a_program_that_pauses_a_little_longer_than_the_delay_is_seen_by_the_samples(pause_ms: float) -> None:
    line = Line()
    for _ in range(20):
        line.wait(1.0)
        line.reads(REQUEST, is_open=True)
        line.wait(40.5)
        line.acknowledge()
        line.wait(pause_ms)
        line.acknowledge()
        line.reads(1, lines=1, due=1)
        line.writes()
    assert line.kinds() == []
    assert line.none("request in parts") == {"own pace": 20}


def test_a_person_who_types_is_not_held() -> None:
    line = Line()
    for pause_ms in (80, 130, 44, 210, 95, 160, 70, 43, 300, 120) * 5:
        line.reads(1, is_open=True)
        line.wait(42.0 if pause_ms > 42 else pause_ms)
        line.acknowledge()
        line.wait(max(0.0, pause_ms - 42.0))
        line.acknowledge()
    line.reads(1, lines=1, due=1)
    line.writes()
    assert line.kinds() == []


def test_a_wire_as_long_as_the_gap_is_named_instead() -> None:
    """This side acknowledges at once; the client's Nagle waits for the wire, and no delayed acknowledgement."""
    line = Line(way_ms=43.0)
    for _ in range(10):
        line.wait(50.0)
        line.acknowledge()
        line.reads(REQUEST, is_open=True)
        line.wait(43.1)
        line.acknowledge()
        line.reads(1, lines=1, due=1)
        line.writes()
    assert line.kinds() == ["kst-slow-wire"]
    (found,) = line.watch.findings()
    assert (found.whose, found.figures["least_round_trip_ms"]) == (Whose.WIRE, 43.0)
    assert line.none("request in parts") == {"network": 10}


def test_behind_a_long_wire_the_delay_is_the_rest_of_the_gap() -> None:
    line = asks_in_parts(Line(way_ms=30.0), delay_ms=42.0, way_ms=30.1)
    assert line.kinds() == ["kst-request-in-parts", "kst-slow-wire"]
    assert 41.0 < float(line.watch.findings()[0].figures["delay_ms"] or 0) < 43.0


def test_what_is_sent_again_is_no_stall() -> None:
    line = Line()
    for _ in range(6):
        line.reads(REQUEST, is_open=True)
        line.wait(42.0)
        line.again += 1
        line.acknowledge()
        line.acknowledge()
        line.reads(1, lines=1, due=1)
        line.writes()
    assert line.kinds() == ["kst-retransmissions"]
    assert line.none("request in parts") == {"network": 6}


def test_what_this_process_read_late_is_not_the_clients() -> None:
    line = Line()
    for _ in range(6):
        line.reads(REQUEST, is_open=True)
        line.wait(42.0)
        line.acknowledge()
        line.acknowledge()
        line.reads(1, lines=1, due=1, late_ms=20)
        line.writes()
    assert line.kinds() == []
    assert line.none("request in parts") == {"late here": 6}


def test_parts_that_nothing_holds_are_a_note() -> None:
    line = Line()
    for _ in range(5):
        line.wait(4.0)
        line.reads(REQUEST, is_open=True)
        line.wait(0.05)
        line.reads(1, lines=1, due=1)
        line.writes()
    assert line.kinds() == ["kst-parts-not-held"]
    assert line.watch.findings()[0].severity is Severity.NOTE


def test_a_reply_in_between_carries_the_acknowledgement() -> None:
    """The beginning of the next request came with the one before; the reply to that acknowledges both."""
    line = Line()
    for _ in range(10):
        line.reads(REQUEST, lines=1, due=1, is_open=True)
        line.writes()
        line.wait(44.0)
        line.acknowledge()
        line.acknowledge()
    assert line.kinds() == []
    assert line.none("request in parts") == {}


@pytest.mark.parametrize("pause_ms", [12.0, 75.0])
def test_what_no_delay_of_this_kernel_fits_is_the_clients_own_pause(pause_ms: float) -> None:
    line = Line()
    for _ in range(6):
        line.reads(REQUEST, is_open=True)
        line.at_ms += pause_ms  # Nobody came to sample.
        line.acknowledge()
        line.acknowledge()
        line.reads(1, lines=1, due=1)
        line.writes()
    assert line.kinds() == []
    assert line.none("request in parts") == {"own pace": 6}


def test_no_sample_is_wanted_while_a_reply_is_due() -> None:
    line = Line()
    line.reads(REQUEST, lines=1, due=1)
    assert line.watch.due_ns is None
    line.reads(REQUEST, lines=1)
    assert line.watch.due_ns is not None


def streams(line: Line, *, bursts: int, at_a_time: int = 21, segments: int = 1, size: int = 1400) -> Line:
    """A set-point, silence until this side's late acknowledgement, then all that was collected."""
    for _ in range(bursts):
        line.wait(1.9)
        line.reads(64, lines=1)
        line.wait(42.8)
        line.acknowledge()
        for _ in range(segments):
            line.acknowledge()
        line.reads(size, lines=at_a_time, segments=segments)
        for _ in range(30):
            line.wait(1.9)
            line.acknowledge()
            line.reads(64, lines=1)
        # A query: its reply makes this kernel wait for replies again.
        line.wait(1.9)
        line.reads(19, lines=1, due=1)
        line.writes()
    return line


def test_set_points_without_replies_in_bursts_are_the_clients_nagle() -> None:
    line = streams(Line(), bursts=6)
    assert line.kinds() == ["kst-stream-in-bursts"]
    (found,) = line.watch.findings()
    assert (found.whose, found.figures["requests_at_a_time"]) == (Whose.PEER, 21.0)
    assert "6 times its requests without replies came 21 at a time after 42.8 ms of silence" in found.sentence
    assert "the arm gets 23 set-points a second then, of the 491 that are sent" in found.sentence


def test_lines_that_left_one_by_one_and_were_read_late_are_no_burst() -> None:
    line = streams(Line(), bursts=6, segments=21)
    assert line.kinds() == []
    assert line.stalls("stream in bursts") == 0


def test_a_program_that_writes_set_points_in_bursts_of_its_own_is_not_held() -> None:
    line = Line()
    for _ in range(40):
        line.wait(42.0)
        line.acknowledge()
        line.reads(512, lines=8)
    assert line.kinds() == []
    assert line.none("stream in bursts") == {"own pace": 39}


@pytest.mark.parametrize("lines", [1, 2])
def test_a_slow_loop_without_replies_is_not_held(lines: int) -> None:
    line = Line()
    for _ in range(100):
        line.wait(40.0)
        line.acknowledge()
        line.acknowledge()
        line.reads(64, lines=lines)
    assert line.kinds() == []


def test_bursts_that_end_in_a_line_are_not_parts_of_a_request() -> None:
    """TCP cuts where a segment is full; no program wrote that part by itself."""
    line = Line(full_bytes=1448)
    for _ in range(10):
        line.wait(43.2)
        line.acknowledge()
        line.reads(1448, lines=22, is_open=True)
        line.wait(43.2)
        line.acknowledge()
        line.acknowledge()
        line.reads(24, lines=1)
    assert line.kinds() == ["kst-bursts-unclear"]


def test_a_burst_that_is_one_segment_though_the_kernel_thinks_it_full_is_the_programs_own() -> None:
    line = Line(full_bytes=560)
    for _ in range(10):
        line.wait(43.2)
        line.acknowledge()
        line.reads(568, lines=8)
    assert line.kinds() == []
    assert line.none("stream in bursts") == {"own pace": 9}


def test_bursts_of_full_segments_may_be_either() -> None:
    line = Line(full_bytes=1448)
    for _ in range(10):
        line.wait(43.2)
        line.acknowledge()
        line.reads(1472, lines=23, segments=2)
    assert line.kinds() == ["kst-bursts-unclear"]
    assert "TCP_NODELAY there tells which" in line.watch.findings()[0].sentence


def test_blocks_that_come_once_a_second_are_no_stream() -> None:
    line = Line(full_bytes=1448)
    for _ in range(10):
        line.wait(1000.0)
        line.acknowledge()
        line.reads(2900, lines=45, segments=3)
    assert line.kinds() == []


def moves(line: Line, *, count: int, held_ms: float, gap_ms: float = 5.0, held: int = 5) -> Line:
    """A start of a motion, its first reply, the second one, which waits until the first was acknowledged."""
    for _ in range(count):
        line.wait(50.0)
        line.reads(10, lines=1, due=1)
        line.unacknowledged = 1
        line.writes()
        line.wait(gap_ms)
        line.writes(held=held)
        line.wait(held_ms)
        line.unsent = line.unacknowledged = 0
        line.wait(2.0)
    return line


@pytest.mark.parametrize(("delay_ms", "system"), [(43.0, "Linux does (40 ms)"), (203.0, "Windows does (200 ms)")])
def test_a_second_reply_that_waits_for_the_clients_acknowledgement_is_this_sides_nagle(
    delay_ms: float, system: str
) -> None:
    line = moves(Line(nagle=True), count=4, held_ms=delay_ms - 5.0)
    assert line.kinds() == ["kst-reply-held"]
    (found,) = line.watch.findings()
    assert (found.severity, found.whose) == (Severity.WARNING, Whose.CONTROLLER)
    assert "held 4 of 8 replies back" in found.sentence
    assert f"as {system}" in found.sentence
    assert "without --kst-nagle" in found.remedies[0]
    assert "on a Cabinet the server cannot be changed" in found.remedies[1]
    assert abs(float(found.figures["median_ms"] or 0) - (delay_ms - 5.0)) < 2.0, "good to the samples"


def test_a_second_reply_that_waits_for_the_wire_alone_is_no_stall() -> None:
    line = moves(Line(nagle=True, way_ms=30.0), count=10, held_ms=26.0)
    assert line.kinds() == ["kst-slow-wire"]
    assert line.none("reply held") == {"network": 10}


def test_a_second_reply_that_hardly_waits_is_no_stall() -> None:
    line = moves(Line(nagle=True), count=10, held_ms=1.5)
    assert line.kinds() == []
    assert line.none("reply held") == {"prompt": 10}


def test_a_second_reply_that_was_sent_again_is_the_wires() -> None:
    line = Line(nagle=True)
    for _ in range(4):
        line.unacknowledged = 1
        line.writes()
        line.writes(held=5)
        line.again += 1
        line.wait(200.0)
        line.unsent = 0
        line.wait(2.0)
    assert line.kinds() == ["kst-retransmissions"]


def test_without_nagle_here_nothing_is_called_its_fault() -> None:
    line = moves(Line(nagle=False), count=10, held_ms=40.0)
    assert line.kinds() == []
    assert line.none("reply held") == {"unclear": 10}


def test_a_client_that_is_gone_is_not_waited_for() -> None:
    line = Line(nagle=True)
    line.unacknowledged = 1
    line.writes()
    line.writes(held=5)
    line.wait(10_000.0)
    assert line.watch.due_ns is None
    assert line.samples < 700
    assert line.none("reply held") == {"unclear": 1}


def test_replies_a_client_does_not_read_are_not_nagles() -> None:
    line = moves(Line(nagle=True), count=5, held_ms=40.0, held=30_000)
    assert line.kinds() == []


def test_where_the_kernel_tells_nothing_nothing_is_claimed() -> None:
    line = asks_in_parts(Line(tells=False))
    assert line.kinds() == []
    assert line.none("request in parts") == {"unclear": 12}
    assert line.watch.report()["kernel_tells"] is False


def test_a_good_client_gives_no_finding_no_sample_and_its_figures() -> None:
    line = ping_pong(Line(), count=2000, pace_ms=2.1)
    assert line.kinds() == []
    assert line.samples == 0
    report = line.watch.report()
    assert (report["requests"], report["replies"], report["requests_without_reply"]) == (2000, 2000, 0)
    assert abs(float(str(report["requests_per_s"])) - 476) < 3


def test_a_clients_own_slow_loop_is_named() -> None:
    line = ping_pong(Line(), count=150, pace_ms=40.0)
    assert line.kinds() == ["kst-client-pace"]
    (found,) = line.watch.findings()
    assert (found.severity, found.whose) == (Severity.NOTE, Whose.APPLICATION)
    assert "TCP holds nothing back" in found.sentence


def test_a_person_is_no_slow_loop() -> None:
    assert ping_pong(Line(), count=150, pace_ms=900.0).kinds() == []


def test_a_finding_is_told_again_when_it_became_much_worse() -> None:
    line = asks_in_parts(ping_pong(Line(), count=300, pace_ms=2.0), count=4)
    assert [finding.severity for finding in line.watch.news()] == [Severity.WARNING]
    asks_in_parts(line, count=6)
    assert line.watch.news() == []
    asks_in_parts(line, count=30)
    assert [finding.figures["count"] for finding in line.watch.news()] == [40]
    asks_in_parts(line, count=100)
    assert [finding.severity for finding in line.watch.news()] == [Severity.FAULT]
    assert line.watch.news() == []


def test_samples_end_by_themselves() -> None:
    line = Line()
    line.reads(REQUEST, is_open=True)
    line.wait(60_000.0)
    assert line.watch.due_ns is None
    assert 0 < line.samples <= SAMPLE_UNTIL_NS // MS


counts = st.one_of(st.none(), st.integers(0, 2**32 - 1), st.integers(0, 5))
kernels = st.one_of(
    st.none(),
    st.builds(
        Kernel,
        st.floats(0, 4e6),
        st.integers(0, 2**32 - 1),
        st.integers(0, 2**32 - 1),
        counts,
        st.one_of(st.none(), st.floats(0, 4e6)),
        counts,
        counts,
        st.floats(0, 4e6),
        st.integers(0, 2**32 - 1),
        st.integers(0, 2**32 - 1),
    ),
)
numbers = st.integers(-3, 2**40)
calls = st.one_of(
    st.builds(
        lambda size, lines, due, is_open, kernel: (
            lambda watch, at: watch.received(
                at, bytes_read=size, lines=lines, replies_due=due, line_open=is_open, kernel=kernel
            )
        ),
        numbers,
        st.one_of(st.integers(0, 30), numbers),
        st.one_of(st.integers(0, 2), numbers),
        st.booleans(),
        kernels,
    ),
    st.builds(lambda size, kernel: lambda watch, at: watch.written(at, size=size, kernel=kernel), numbers, kernels),
    st.builds(lambda kernel: lambda watch, at: watch.sampled(at, kernel), kernels),
)
steps = st.one_of(st.integers(0, 100 * MS), st.integers(-(10**12), 10**15))


@given(st.booleans(), st.lists(st.tuples(steps, calls), max_size=60))
def test_it_never_raises_and_always_reports(
    nagle: bool, told: list[tuple[int, Callable[[StallWatch, int], None]]]
) -> None:
    watch, at_ns = StallWatch(nagle), 0
    for step_ns, call in told:
        at_ns += step_ns
        call(watch, at_ns)
        watch.news()
    json.dumps(watch.report(), allow_nan=False)


def test_it_stays_as_small_however_long_it_runs() -> None:
    line = asks_in_parts(streams(moves(Line(nagle=True), count=5, held_ms=40.0), bursts=5), count=600)
    before = len(json.dumps(line.watch.report()))
    kept = sum(len(tally.waits_ms) + len(tally.delays_ms) for tally in line.watch._tallies.values())
    asks_in_parts(streams(moves(line, count=300, held_ms=40.0), bursts=300), count=3000)
    assert len(json.dumps(line.watch.report())) < before * 1.3
    assert sum(len(tally.waits_ms) + len(tally.delays_ms) for tally in line.watch._tallies.values()) < kept + 1200


@given(st.lists(st.integers(0, 10**12), min_size=1, max_size=200), st.floats(0.0, 1.0))
def test_a_quantile_is_good_to_ten_percent(times_ns: list[int], fraction: float) -> None:
    spread = Spread()
    for time_ns in times_ns:
        spread.add(time_ns)
    ordered = sorted(times_ns)
    exact_ms = ordered[max(0, min(len(ordered) - 1, -int(-len(ordered) * fraction // 1) - 1))] / MS
    found_ms = spread.quantile_ms(fraction)
    assert exact_ms * 0.999 <= found_ms or exact_ms > 73_000
    assert found_ms <= max(0.05, exact_ms * 1.11) or found_ms == spread.longest_ns / MS


@given(st.integers(0, 10**6), st.floats(20.0, 600.0), st.integers(0, 10**6), st.integers(0, 10**6))
def test_sentences_are_made_of_any_figures(count: int, wait_ms: float, against: int, requests: int) -> None:
    waits = Waits(count, wait_ms, wait_ms, wait_ms, lines=3 * count, against=against)
    found = findings_of(Seen(waits, waits, waits, waits, nagle=True, requests=requests, replies=requests))
    certain = count >= SEVERAL and count >= 2 * against
    assert ("kst-request-in-parts" in [finding.kind for finding in found]) is certain
