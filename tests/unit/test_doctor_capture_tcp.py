"""Slow TCP connections are recognised from their segments, and what cannot be known is not claimed."""

from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.values.finding import Diagnosis, Finding, Severity, Whose
from tests.support.cases import cases
from tests.support.segments import CLIENT, SERVER, Talk
from tools.doctor.capture.tcp.connections import Connections
from tools.doctor.capture.tcp.diagnose import MAX_FINDINGS, tell
from transport.capture.tcp import ACK, FIN, RST, SYN, Segment, SynOptions


def diagnosis(*talks: Talk) -> Diagnosis:
    segments = [segment for talk in talks for segment in talk.segments]
    segments.sort(key=lambda one: one.at_unix_ns)
    connections = Connections()
    connections.take(one._replace(number=number) for number, one in enumerate(segments, 1))
    return Diagnosis(*tell(connections.end(), left_out=connections.left_out))


def kinds(*talks: Talk) -> list[str]:
    return [finding.kind for finding in diagnosis(*talks).findings]


def only(kind: str, *talks: Talk) -> Finding:
    (found,) = [finding for finding in diagnosis(*talks).findings if finding.kind == kind]
    return found


def asks_in_two_parts(talk: Talk, *, delay_ms: float, answer_ms: float = 0.35, count: int = 10) -> Talk:
    """Body, a delayed acknowledgement, line end, answer."""
    at_ms = 100.0
    for _ in range(count):
        talk.client(at_ms, 20)
        talk.server(at_ms + delay_ms)
        talk.client(at_ms + delay_ms + 0.05, 1)
        talk.server(at_ms + delay_ms + 0.05 + answer_ms, 5)
        at_ms += delay_ms + answer_ms + 1.0
    return talk


def ping_pong(talk: Talk, *, answer_ms: float = 0.5, count: int = 50, period_ms: float = 5.0) -> Talk:
    for number in range(count):
        talk.client(10 + number * period_ms, 30)
        talk.server(10 + number * period_ms + answer_ms, 5)
    return talk


@pytest.mark.parametrize(
    ("delay_ms", "system", "rate"),
    [
        (40.3, "as Linux does", 25),
        (200.0, "as Windows does", 5),
        (110.0, "the manual has more than 100 ms for Windows", 9),
    ],
)
def test_a_delayed_acknowledgement_that_frees_the_next_part_is_nagle(delay_ms: float, system: str, rate: int) -> None:
    found = diagnosis(asks_in_two_parts(Talk().handshake(), delay_ms=delay_ms)).verdict
    assert (found.kind, found.severity, found.whose) == ("tcp-nagle", Severity.FAULT, Whose.CONFIGURATION)
    assert found.sentence.startswith("the client 172.31.1.100:51234 needs TCP_NODELAY: 10 times in 20 segments")
    assert f"the server 172.31.1.147:30001, which acknowledges about {delay_ms:.0f} ms late" in found.sentence
    assert system in found.sentence
    assert f"at most {rate} exchanges a second" in found.sentence
    assert found.evidence[0].startswith(f"stalls of the client 172.31.1.100:51234: n(10) T({delay_ms + 0.05:.2f}, ")
    assert "packet 4: 20 bytes" in found.evidence[1]
    assert "packet 5: the server" in found.evidence[1]
    assert "packet 6: 50 us after that" in found.evidence[1]
    assert found.figures["first_packet"] == 6
    assert any("TCP_NODELAY" in remedy and str(CLIENT[1]) in remedy for remedy in found.remedies)


def test_the_side_at_fault_is_the_one_that_waits() -> None:
    talk = Talk().handshake()
    for number in range(10):
        at_ms = 10 + number * 50
        talk.client(at_ms, 10)
        talk.server(at_ms + 0.3, 7)
        talk.client(at_ms + 40.3)
        talk.server(at_ms + 40.6, 1)
    found = diagnosis(talk).verdict
    assert found.sentence.startswith("the server 172.31.1.147:30001 needs TCP_NODELAY")
    assert (found.figures["sender"], found.figures["acknowledger"]) == ("172.31.1.147:30001", "172.31.1.100:51234")
    assert any(line.startswith("until the answer's last segment: n(10) T(40.60,") for line in found.evidence)


def test_a_few_stalls_set_no_rate() -> None:
    """A Cabinet's second reply, soon after its first one, to every short motion and to nothing else (kst-wire.md 9)."""
    talk = ping_pong(Talk().handshake(), count=100)
    for number in range(4):
        at_ms = 1000 + number * 500
        talk.client(at_ms, 40)
        talk.server(at_ms + 0.3, 5)
        talk.client(at_ms + 40.3)
        talk.server(at_ms + 40.4, 5)
    found = only("tcp-nagle", talk)
    assert found.sentence.startswith("the server 172.31.1.147:30001 needs TCP_NODELAY: 4 times in 108 segments")
    assert found.sentence.endswith("had acknowledged what went before; each cost 40.1 ms")


def test_a_stream_without_answers_is_held_too() -> None:
    talk = Talk().handshake()
    for number in range(20):
        talk.client(10 + number * 40.1, 380)
        talk.server(10 + number * 40.1 + 40)
    found = only("tcp-nagle", talk)
    assert "19 times in 20 segments" in found.sentence
    assert "tcp-slow-program" not in kinds(talk)


LOOPBACK = SynOptions(65495, 7, has_timestamps=True)


def test_what_was_collected_may_be_larger_than_ethernets_segments() -> None:
    """A stream on one machine: Nagle holds what does not fill a segment, and that is 65 kB there."""
    talk = Talk().handshake(to_server_ms=0.02, options=LOOPBACK)
    for number in range(8):
        at_ms = 10 + number * 100.0
        talk.client(at_ms, 71)
        talk.server(at_ms + 42)
        talk.client(at_ms + 42.02, 1491)
        talk.server(at_ms + 42.03)
    found = only("tcp-nagle", talk)
    assert found.figures["stalls"] == 8


def test_a_large_segment_that_leaves_unasked_is_no_proof_that_nothing_is_held() -> None:
    talk = Talk().handshake(to_server_ms=0.02, options=LOOPBACK)
    for number in range(8):
        at_ms = 10 + number * 100.0
        talk.client(at_ms, 71)
        talk.client(at_ms + 5, 30_000)
        talk.server(at_ms + 42)
        talk.client(at_ms + 42.02, 71)
        talk.server(at_ms + 42.03)
    assert "TCP_NODELAY is set there" not in str(diagnosis(talk).as_dict())


def test_one_or_two_may_be_chance() -> None:
    found = only("tcp-nagle", asks_in_two_parts(Talk().handshake(), delay_ms=40, count=2))
    assert found.severity is Severity.WARNING
    assert "may need TCP_NODELAY: 2 times" in found.sentence
    assert "seen 2 times only: that may be chance" in found.evidence


def test_a_side_that_does_not_wait_has_no_delay_set() -> None:
    talk = Talk().handshake()
    for number in range(20):
        at_ms = 10 + number * 5
        talk.client(at_ms, 20)
        talk.client(at_ms + 0.01, 1)
        talk.server(at_ms + 0.3, 5)
    found = diagnosis(talk).verdict
    assert (found.kind, found.severity) == ("tcp-healthy", Severity.GOOD)
    assert "n(20) T(0.30, 0.30, 0.30 msec)" in found.sentence
    assert any("TCP_NODELAY is set there; 20 of its messages are in small parts" in line for line in found.evidence)


def test_a_program_that_sends_every_41_ms_is_not_taken_for_nagle() -> None:
    """Its messages leave just after the delayed acknowledgement, and sometimes just before: nothing holds them."""
    talk = Talk().handshake()
    for number in range(40):
        at_ms = 10 + number * 41.0
        talk.client(at_ms, 30)
        if number % 4:
            talk.server(at_ms + 40.2)
    assert kinds(talk) == ["tcp-healthy"]


def test_a_pause_after_a_delayed_acknowledgement_is_the_programs_own() -> None:
    talk = Talk().handshake()
    for number in range(20):
        talk.client(10 + number * 100, 30)
        talk.server(10 + number * 100 + 40)
    assert kinds(talk) == ["tcp-healthy"]


def test_pauses_between_stalls_are_not_counted_as_stalls() -> None:
    talk = asks_in_two_parts(Talk().handshake(), delay_ms=40)
    for number in range(5):
        talk.client(1000 + number * 100, 30)
        talk.server(1040 + number * 100)
    found = only("tcp-nagle", talk)
    assert found.figures["stalls"] == 10
    assert "4 times it sent later than that, at its own pace: not counted" in found.evidence


def test_a_connection_that_ends_with_a_full_buffer_is_not_full_for_ever() -> None:
    over = ping_pong(Talk().handshake(), count=5)
    over.client(100, 1460)
    over.server(100.5, window=0)
    over.client(104, flags=RST | ACK)
    later = ping_pong(Talk(client=("10.0.0.9", 4000)).handshake(), count=100)
    assert only("tcp-zero-window", over, later).figures["closed_max_ms"] == 3.5


def test_parts_that_wait_for_a_prompt_acknowledgement_are_a_risk() -> None:
    found = diagnosis(asks_in_two_parts(Talk().handshake(), delay_ms=0.3))
    assert [one.kind for one in found.findings] == ["tcp-healthy", "tcp-held"]
    assert "in order, but for what is noted" in found.verdict.sentence
    held = found.findings[1]
    assert (held.severity, held.whose) == (Severity.NOTE, Whose.APPLICATION)
    assert "the client 172.31.1.100:51234 holds small segments back until the server" in held.sentence
    assert "10 times in 20 segments, 0.35 ms on average" in held.sentence
    assert found.healthy


def test_parts_that_nothing_holds_yet_are_a_risk_too() -> None:
    talk = Talk().handshake()
    for number in range(5):
        talk.client(10 + number * 20, 20)
        talk.server(10.3 + number * 20)
        talk.client(12 + number * 20, 1)
        talk.server(12.3 + number * 20, 5)
    found = only("tcp-message-in-parts", talk)
    assert (found.severity, found.whose) == (Severity.NOTE, Whose.APPLICATION)
    assert "writes a message in small parts (5 times)" in found.sentence


def test_a_program_that_sends_every_millisecond_is_not_held() -> None:
    talk = Talk().handshake()
    for number in range(100):
        talk.client(10 + number, 20)
        talk.server(10.2 + number)
    assert kinds(talk) == ["tcp-healthy"]


def test_a_long_wire_is_no_delayed_acknowledgement() -> None:
    talk = asks_in_two_parts(Talk().handshake(to_server_ms=40, to_client_ms=0.02), delay_ms=40.1, answer_ms=40.2)
    found = diagnosis(talk)
    assert [one.kind for one in found.findings] == ["tcp-slow-wire", "tcp-held"]
    assert "10 times in 20 segments, 40.15 ms on average" in found.findings[1].sentence
    assert (found.verdict.whose, found.verdict.figures["round_trip_ms"]) == (Whose.WIRE, 40.02)
    assert "takes 40.0 ms for a round trip" in found.verdict.sentence


def test_behind_a_long_wire_the_acknowledgement_is_delayed_by_the_rest() -> None:
    talk = asks_in_two_parts(Talk().handshake(to_server_ms=30, to_client_ms=0.02), delay_ms=70.5, answer_ms=30.2)
    found = only("tcp-nagle", talk)
    assert "acknowledges about 40 ms late, as Linux does" in found.sentence


def test_captured_beside_the_other_side_the_release_takes_its_way() -> None:
    talk = Talk().handshake(to_server_ms=0.02, to_client_ms=8.0)
    for number in range(10):
        at_ms = 20 + number * 60
        talk.client(at_ms, 20)
        talk.server(at_ms + 40)
        talk.client(at_ms + 48.1, 1)
        talk.server(at_ms + 48.3, 5)
    found = only("tcp-nagle", talk)
    assert any("beside the server 172.31.1.147:30001, so times of the client" in line for line in found.evidence)


@pytest.mark.parametrize(
    ("to_server_ms", "to_client_ms", "told"),
    [
        (0.4, 0.02, "beside the client"),
        (0.02, 0.4, "beside the server"),
        (0.3, 0.25, "beside which side cannot be known"),
        (0.1, 0.01, "beside which side cannot be known"),
    ],
)
def test_where_it_was_captured_is_said_where_the_handshake_tells(
    to_server_ms: float, to_client_ms: float, told: str
) -> None:
    talk = ping_pong(Talk().handshake(to_server_ms=to_server_ms, to_client_ms=to_client_ms))
    assert any(told in line for line in diagnosis(talk).verdict.evidence)


def test_a_capture_that_begins_later_still_tells_nagle_by_the_quick_answers() -> None:
    found = only("tcp-nagle", asks_in_two_parts(Talk(), delay_ms=40, count=20))
    assert found.figures["stalls"] == 19  # what is quick is known after the first
    assert any("cannot be known: the connection's beginning is not in it" in line for line in found.evidence)


def test_a_capture_that_begins_later_and_has_slow_acknowledgements_alone_cannot_tell() -> None:
    talk = Talk()
    for number in range(20):
        talk.client(10 + number * 40.1, 380)
        talk.server(10 + number * 40.1 + 40)
    found = diagnosis(talk).verdict
    assert (found.kind, found.whose) == ("tcp-nagle-or-wire", Whose.PEER_OR_WIRE)
    assert "delayed acknowledgements or a wire this long" in found.sentence
    assert "capture again from before the connection is made" in found.remedies[0]


def test_sequence_numbers_wrap() -> None:
    talk = Talk(client_sequence=(1 << 32) - 100, server_sequence=(1 << 32) - 20).handshake()
    found = diagnosis(asks_in_two_parts(talk, delay_ms=40))
    assert [one.kind for one in found.findings] == ["tcp-nagle"]
    assert found.verdict.figures["stalls"] == 10


def test_what_is_sent_again_is_the_wires_fault() -> None:
    talk = ping_pong(Talk().handshake(), count=20)
    lost = talk.client(200, 30)
    talk.again(lost, 405)
    talk.server(405.5, 5)
    found = diagnosis(talk).verdict
    assert (found.kind, found.severity, found.whose) == ("tcp-retransmission", Severity.WARNING, Whose.WIRE)
    assert f"again, 1 of them after a timeout, the first in packet {lost.number + 1}" in found.sentence
    assert "the client 172.31.1.100:51234 sent 1 of 21 segments to the server" in found.sentence
    assert "the longest silence before was 205.0 ms: they, or their acknowledgements, were lost" in found.sentence


def test_what_had_arrived_was_not_lost() -> None:
    talk = ping_pong(Talk().handshake(to_server_ms=0.02, to_client_ms=0.4), count=20)
    arrived = talk.client(200, 30)
    talk.again(arrived, 405)
    talk.server(405.5, 5)
    found = only("tcp-retransmission", talk)
    assert "they had arrived, so their acknowledgements were lost on the wire or came too late" in found.sentence
    assert found.whose is Whose.PEER_OR_WIRE


def test_one_quick_repetition_is_a_note() -> None:
    talk = ping_pong(Talk().handshake(), count=20)
    talk.again(talk.client(200, 30), 206)
    talk.server(206.5, 5)
    assert kinds(talk) == ["tcp-healthy", "tcp-retransmission"]


def test_a_segment_that_was_lost_before_the_capture_is_found_by_its_gap() -> None:
    talk = ping_pong(Talk().handshake(), count=20)
    lost = talk.lose(talk.client(200, 30))
    talk.client(200.1, 30)
    talk.again(lost, 230)
    talk.server(230.3, 5)
    found = only("tcp-retransmission", talk)
    assert (found.figures["silence_count"], found.figures["lost_before_capture"]) == (1, 1)


def test_segments_that_overtake_each_other_are_not_lost() -> None:
    talk = ping_pong(Talk().handshake(), count=20)
    first = talk.lose(talk.client(200, 30))
    talk.client(200.1, 30)
    talk.again(first, 200.2)
    talk.server(200.6, 5)
    assert kinds(talk) == ["tcp-healthy"]


def test_a_packet_that_was_recorded_twice_was_sent_once() -> None:
    talk = ping_pong(Talk().handshake())
    talk.segments = [
        one for segment in talk.segments for one in (segment, segment._replace(at_unix_ns=segment.at_unix_ns + 9000))
    ]
    assert kinds(talk) == ["tcp-healthy"]


def test_data_that_was_not_captured_is_told() -> None:
    talk = ping_pong(Talk().handshake(), count=20)
    talk.lose(talk.client(200, 30))
    talk.server(200.5, 5)
    assert kinds(talk) == ["tcp-healthy", "tcp-not-captured"]


def test_a_full_buffer_is_the_readers_fault() -> None:
    talk = ping_pong(Talk().handshake(), count=5)
    talk.client(100, 1460)
    talk.server(100.5, window=0)
    talk.client(300, 1)  # a question whether there is room again
    talk.server(300.2, window=0)
    talk.server(1100.5, window=500)
    found = diagnosis(talk).verdict
    assert (found.kind, found.severity, found.whose) == ("tcp-zero-window", Severity.WARNING, Whose.PEER)
    assert "the program at the server 172.31.1.147:30001 does not read" in found.sentence
    assert "full once, up to 1000.0 ms" in found.sentence


def test_a_buffer_that_stays_full_is_counted_to_the_end() -> None:
    talk = ping_pong(Talk().handshake(), count=5)
    talk.client(100, 1460)
    talk.server(100.5, window=0)
    talk.server(700.5, window=0)
    assert only("tcp-zero-window", talk).figures["closed_max_ms"] == 600.0


def test_a_slow_answer_after_an_acknowledgement_is_the_programs() -> None:
    talk = Talk().handshake()
    for number in range(20):
        at_ms = 10 + number * 100
        talk.client(at_ms, 30)
        talk.server(at_ms + 40)
        talk.server(at_ms + 63, 5)
    found = diagnosis(talk).verdict
    assert (found.kind, found.severity, found.whose) == ("tcp-slow-program", Severity.WARNING, Whose.PEER)
    assert "the program at the server 172.31.1.147:30001 takes its time: 62.8 ms on average" in found.sentence
    assert "the peer's application" in found.sentence
    assert found.figures["thinking_count"] == 20


@pytest.mark.parametrize(
    ("to_server_ms", "to_client_ms", "kind", "whose"),
    [
        (0.02, 0.4, "tcp-slow-program", Whose.PEER),
        (0.4, 0.02, "tcp-late-answers", Whose.PEER_OR_WIRE),
        (0.02, 0.02, "tcp-late-answers", Whose.PEER_OR_WIRE),
    ],
)
def test_a_late_answer_now_and_then_may_have_been_lost_unless_captured_beside_who_answers(
    to_server_ms: float, to_client_ms: float, kind: str, whose: Whose
) -> None:
    talk = ping_pong(Talk().handshake(to_server_ms=to_server_ms, to_client_ms=to_client_ms), count=40)
    talk.client(300, 30)
    talk.server(2300, 5)
    found = diagnosis(talk)
    assert [one.kind for one in found.findings] == ["tcp-healthy", kind]
    assert "in order, but for what is noted" in found.verdict.sentence
    assert found.findings[1].whose is whose
    assert ("a capture beside the server" in found.findings[1].sentence) == (whose is Whose.PEER_OR_WIRE)
    assert found.healthy


def test_a_refused_connection_and_one_that_is_never_answered() -> None:
    refused, silent = Talk(), Talk(client=("10.0.0.9", 4000))
    syn = refused.client(0, flags=SYN)
    refused.server(0.3, flags=RST | ACK)
    first = silent.client(5, flags=SYN)
    silent.again(first, 1005)
    silent.again(first, 3005)
    assert syn.number == 1
    sentences = sorted(one.sentence for one in diagnosis(refused, silent).findings)
    assert "never answered the client 10.0.0.9:4000, which asked for a connection 3 times from packet 3" in sentences[0]
    assert "refused the connection of the client 172.31.1.100:51234 (packet 1)" in sentences[1]


def test_a_reset_is_noted() -> None:
    talk = ping_pong(Talk().handshake())
    last = talk.server(900, flags=RST | ACK)
    assert f"reset in packet {last.number}" in only("tcp-reset", talk).sentence


def test_a_segment_that_ends_the_connection_is_not_held_anyway() -> None:
    talk = asks_in_two_parts(Talk().handshake(), delay_ms=40)
    talk.client(900, 3)
    talk.client(900.1, 1, flags=FIN | ACK)
    found = only("tcp-nagle", talk)
    assert not any("held nothing back" in line for line in found.evidence)


def test_no_delay_that_is_set_later_is_said() -> None:
    talk = asks_in_two_parts(Talk().handshake(), delay_ms=40)
    talk.client(900, 3)
    second = talk.client(900.1, 1)
    found = only("tcp-nagle", talk)
    assert any(f"from packet {second.number} on the client" in line for line in found.evidence)


def test_each_connection_has_its_own_verdict_the_worst_first() -> None:
    good = ping_pong(Talk(client=("10.0.0.9", 4000)).handshake(), count=200)
    bad = asks_in_two_parts(Talk().handshake(), delay_ms=40)
    found = diagnosis(good, bad)
    assert [one.kind for one in found.findings] == ["tcp-nagle", "tcp-healthy"]
    (table,) = found.tables
    assert [row[0] for row in table.rows] == ["172.31.1.100:51234", "10.0.0.9:4000"]
    assert table.rows[0][4:] == ("10", "0", "tcp-nagle")


@pytest.mark.parametrize("sequence", [777_000, 1000])
def test_the_same_ports_again_are_another_connection(sequence: int) -> None:
    first = ping_pong(Talk(client_sequence=1000).handshake(), count=5)
    second = ping_pong(Talk(client_sequence=sequence, server_sequence=5).handshake(), count=5)
    second.segments = [one._replace(at_unix_ns=one.at_unix_ns + 10**9) for one in second.segments]
    assert kinds(first, second) == ["tcp-healthy", "tcp-healthy"]


def test_many_healthy_connections_are_told_in_one_sentence() -> None:
    talks = [ping_pong(Talk(client=("10.0.0.9", 4000 + number)).handshake(), count=5) for number in range(9)]
    found = diagnosis(*talks)
    assert [one.kind for one in found.findings] == ["tcp-healthy"] * 4
    assert found.findings[3].sentence == "6 more TCP connections are in order"
    assert len(found.tables[0].rows) == 9


def test_half_a_window_on_loopback_is_no_small_segment() -> None:
    """As Linux sends 300 kB behind a short head: what is smaller than the largest segment was not held, nor small."""
    talk = Talk(window=65_535).handshake(options=SynOptions(65_495, 0, has_timestamps=True))
    for number in range(20):
        at_ms = 10 + number * 5
        talk.client(at_ms, 80)
        talk.server(at_ms + 0.1, 90)
        talk.server(at_ms + 0.11, 32_741)
        talk.client(at_ms + 0.13)
    found = diagnosis(talk).verdict
    assert found.kind == "tcp-healthy"
    assert not any("TCP_NODELAY is set" in line for line in found.evidence)


def test_without_a_connection_nothing_is_said() -> None:
    assert tell([]) == ((), ())


def scan(count: int) -> Iterator[Segment]:
    for number in range(count):
        talk = Talk(client=("10.0.0.9", 1 + number % 60_000), server=("10.0.0.1", 60_001 + number // 60_000))
        yield talk.client(5000 + number * 0.01, 1)


def test_many_connections_leave_room_for_the_telling_ones() -> None:
    bad = asks_in_two_parts(Talk().handshake(), delay_ms=40)
    connections = Connections(most=64)
    connections.take(bad.segments)
    connections.take(scan(1000))
    found = connections.end()
    assert len(found) <= 64
    assert len(found) + connections.left_out == 1001
    findings, tables = tell(found, left_out=connections.left_out)
    assert findings[0].kind == "tcp-nagle"
    assert len(findings) <= MAX_FINDINGS + 2
    assert f"{connections.left_out} more TCP connections" in findings[-1].sentence
    assert "more TCP connections are in order" in findings[-2].sentence
    assert len(tables[0].rows) <= 40


def test_too_many_findings_are_counted() -> None:
    talks = [asks_in_two_parts(Talk(client=("10.0.0.9", 4000 + n)).handshake(), delay_ms=40) for n in range(30)]
    findings = diagnosis(*talks).findings
    assert [one.kind for one in findings] == ["tcp-nagle"] * MAX_FINDINGS + ["tcp-more"]
    assert findings[-1].sentence == "6 more findings of TCP connections are not shown"


ends = st.sampled_from([CLIENT, SERVER, ("10.0.0.9", 4000), ("255.255.255.255", 0)])
numbers = st.one_of(st.integers(0, 300), st.integers((1 << 32) - 300, (1 << 32) - 1), st.integers(0, (1 << 32) - 1))
options = st.builds(SynOptions, st.none() | st.integers(0, 65_535), st.none() | st.integers(0, 14), st.booleans())
arbitrary = st.builds(
    Segment,
    number=st.integers(1, 10**6),
    at_unix_ns=st.one_of(st.integers(0, 10**9), st.integers(0, (1 << 64) - 1)),
    source=ends,
    destination=ends,
    sequence=numbers,
    acknowledged=numbers,
    flags=st.sampled_from([ACK, ACK, ACK, SYN, SYN | ACK, RST, FIN | ACK, 0, 255]),
    window=st.sampled_from([0, 1, 500, 65_535]),
    size=st.sampled_from([0, 0, 1, 20, 1460, 65_000]),
    identification=st.integers(0, 2),
    syn_options=st.none() | options,
)


@settings(max_examples=cases(60), deadline=None)
@given(st.lists(arbitrary, max_size=40))
def test_any_segments_are_told_without_an_error(segments: list[Segment]) -> None:
    connections = Connections(most=3)
    connections.take(segments)
    findings, tables = tell(connections.end(), left_out=connections.left_out)
    assert bool(segments) or not findings
    assert all(finding.sentence and "nan" not in finding.sentence for finding in findings)
    assert len(connections.end()) <= 3
    assert len(tables) <= 1
