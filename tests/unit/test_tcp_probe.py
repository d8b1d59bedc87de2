"""The responder's protocol: bytes in any pieces, foreign bytes, behaviours, and what one peer may cost."""

import itertools
from collections.abc import Iterator
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.values.errors import ConfigurationError, EndpointError, PeerError
from hil.values.link import Address
from hil.values.tcp_probe import Behaviour
from transport.tcp import (
    BODY_LEAST_BYTES,
    BODY_MOST_BYTES,
    HEAD_BYTES,
    Allowance,
    Ending,
    Greeting,
    NotTheProbe,
    PeerSettings,
    ProbeRefused,
    Reply,
    ReplyReader,
    Request,
    Responder,
    Wishes,
    pack_refusal,
    read_greeting,
)
from transport.tcp.messages import read_request
from transport.tcp.sockets import listen, parse_tcp_address

MS = 1_000_000
S = 1_000_000_000
texts = st.text(alphabet="ab_ \n\r\t\0\x1b\x7fé☃\u2028", max_size=300)
answers = st.sampled_from([None, True, False])
wishes = st.builds(Wishes, answers, answers, answers)
settings = st.builds(PeerSettings, st.booleans(), st.booleans(), st.booleans())
sizes = st.integers(BODY_LEAST_BYTES, BODY_MOST_BYTES)
requests = st.builds(Request, st.integers(0, 2**32 - 1), wishes, sizes)


def pieces(data: bytes, cuts: list[int]) -> Iterator[bytes]:
    edges = [0, *sorted({cut % len(data) for cut in cuts}), len(data)]
    return (data[begin:end] for begin, end in itertools.pairwise(edges) if begin < end)


def responder(behaviour: Behaviour = Behaviour.GOOD) -> Responder:
    return Responder(behaviour, now_ns=0)


def answer_of(served: Responder, request: Request, *, now_ns: int) -> tuple[Reply, list[int]]:
    """Return the reply, and the sizes of its writes."""
    steps = served.steps(now_ns=now_ns)
    reply = ReplyReader(request).feed(b"".join(step.write for step in steps))
    assert reply is not None
    return reply, [len(step.write) for step in steps]


@given(requests)
def test_a_request_is_read_as_it_was_packed(request: Request) -> None:
    assert read_request(b"".join(request.pack())) == request


durations = st.integers(0, 2**62)
replies = st.builds(Reply, st.integers(0, 2**32 - 1), settings, st.integers(0, 2**16 - 1), durations, durations, sizes)


@given(replies, st.lists(st.integers(0, 2000), max_size=5))
def test_a_reply_comes_through_in_any_pieces(reply: Reply, cuts: list[int]) -> None:
    request = Request(reply.sequence, body_bytes=reply.body_bytes)
    reader = ReplyReader(request)
    *before, last = [reader.feed(piece) for piece in pieces(b"".join(reply.pack()), cuts)]
    assert (before, last) == ([None] * len(before), reply)


@given(requests, st.binary(min_size=1, max_size=3000))
def test_foreign_bytes_end_in_an_error_of_ours_or_in_waiting(request: Request, data: bytes) -> None:
    for read in (ReplyReader(request).feed, read_greeting, read_request):
        with suppress(NotTheProbe, ProbeRefused):
            read(data)


@given(st.sampled_from(Behaviour), st.lists(st.binary(max_size=2000), max_size=6))
def test_whatever_comes_in_a_responder_answers_little_and_ends_with_a_sentence(
    behaviour: Behaviour, parts: list[bytes]
) -> None:
    served = responder(behaviour)
    for number, part in enumerate(parts):
        if not served.reads:
            break
        served.receive(part, now_ns=number)
        written = b"".join(step.write for step in served.steps(now_ns=number))
        assert len(written) <= 2 * (HEAD_BYTES + BODY_MOST_BYTES) + 200
        assert (served.ending is Ending.MALFORMED) == written.startswith(b"HIL-TCP-PROBE refused: ")


@given(requests, st.lists(st.integers(0, 2000), max_size=5))
def test_the_responder_answers_requests_in_any_pieces_and_tells_how_far_apart_they_came(
    request: Request, cuts: list[int]
) -> None:
    served = responder()
    parts = list(pieces(b"".join(request.pack()), cuts))
    for number, part in enumerate(parts):
        assert served.steps(now_ns=number * MS) == []
        served.receive(part, now_ns=number * MS)
    reply, writes = answer_of(served, request, now_ns=(len(parts) - 1) * MS + 5)
    assert reply.parts_apart_ns == (len(parts) - 1) * MS
    assert reply.thought_ns == 5
    assert len(writes) == (2 if request.wishes.two_writes else 1)
    assert reply.settings == PeerSettings(two_writes=False, no_delay=True, quick_ack=True).after(request.wishes)


@pytest.mark.parametrize("behaviour", [Behaviour.NAGLE, Behaviour.DELAYED_ACK, Behaviour.DELAYED_ACK_200MS])
def test_a_bad_peer_stays_as_it_is_whatever_it_is_asked(behaviour: Behaviour) -> None:
    served = responder(behaviour)
    before = served.settings
    request = Request(1, Wishes(two_writes=not before.two_writes, no_delay=not before.no_delay, quick_ack=True))
    served.receive(b"".join(request.pack()), now_ns=0)
    reply, _ = answer_of(served, request, now_ns=0)
    assert reply.settings == served.settings == before


def test_an_emulated_late_acknowledgement_holds_only_what_had_to_wait() -> None:
    served = responder(Behaviour.DELAYED_ACK_200MS)
    request = Request(1)
    head, body = request.pack()
    served.receive(head + body, now_ns=0)
    assert answer_of(served, request, now_ns=1)[0].parts_apart_ns == 0
    served.receive(head, now_ns=1000 * MS)
    served.receive(body, now_ns=1044 * MS)
    assert served.steps(now_ns=1199 * MS) == []
    assert not served.reads
    assert served.due_ns == 1200 * MS
    assert answer_of(served, request, now_ns=1200 * MS)[0].parts_apart_ns == 200 * MS
    assert served.reads


def test_two_requests_in_one_piece_are_both_answered() -> None:
    served = responder()
    served.receive(b"".join(Request(1).pack() + Request(2).pack()), now_ns=0)
    assert len(served.steps(now_ns=0)) == served.answered == 2


@pytest.mark.parametrize(
    ("now_ns", "ending", "sentence"),
    [(10 * S, Ending.IDLE, "no request came for 10 s"), (60 * S, Ending.LONG, "a connection lasts 60 s at most")],
)
def test_a_silent_peer_and_one_that_stays_for_ever_are_sent_away(now_ns: int, ending: Ending, sentence: str) -> None:
    served = responder()
    assert served.steps(now_ns=served.due_ns - 1) == []
    refusal = b"".join(step.write for step in served.steps(now_ns=now_ns))
    with pytest.raises(ProbeRefused, match=sentence):
        read_greeting(refusal)
    assert (served.ending, served.reads) == (ending, False)


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"GET / HTTP/1.1\r\n", "is no request"),
        (b"HTPq" + bytes(12), "a body of 0 bytes is outside 16..1024"),
        (b"HTPq" + bytes(8) + b"\xff\xff" + bytes(2), "a body of 65535 bytes is outside"),
        (b"HTPq" + bytes(4) + b"\x03" + bytes(3) + b"\x00\x10" + bytes(18), "wishes 0x03 are none"),
    ],
)
def test_what_is_no_request_ends_the_connection_with_a_sentence(data: bytes, sentence: str) -> None:
    served = responder()
    served.receive(data, now_ns=0)
    with pytest.raises(ProbeRefused, match=sentence):
        read_greeting(b"".join(step.write for step in served.steps(now_ns=0)))
    assert served.ending is Ending.MALFORMED


@given(texts, texts)
def test_a_greeting_is_one_short_line_whatever_the_names(system: str, software: str) -> None:
    line = Greeting(system, software).pack()
    assert len(line) <= 200
    assert line.count(b"\n") == 1
    assert isinstance(read_greeting(line), Greeting)
    assert read_greeting(line[:-1]) is None


@given(texts)
def test_a_refusal_is_one_short_line_of_printable_text(sentence: str) -> None:
    with pytest.raises(ProbeRefused) as caught:
        read_greeting(pack_refusal(sentence))
    assert str(caught.value).isprintable()


def test_a_greeting_that_never_ends_is_refused() -> None:
    with pytest.raises(NotTheProbe, match="longer than 200 bytes"):
        read_greeting(b"HIL-TCP-PROBE 1 " + b"x" * 200)


@pytest.mark.parametrize(
    ("reply", "sentence"),
    [
        (Reply(2, PeerSettings(False, True, True), 0, 0, 0), "reply 2 of 16 bytes came, where 1 of 16"),
        (Reply(1, PeerSettings(False, True, True), 0, 0, 0, 17), "reply 1 of 17 bytes came"),
    ],
)
def test_another_reply_than_the_one_waited_for_is_refused(reply: Reply, sentence: str) -> None:
    with pytest.raises(PeerError, match=sentence):
        ReplyReader(Request(1)).feed(b"".join(reply.pack()))


def test_bytes_after_a_reply_are_refused() -> None:
    with pytest.raises(PeerError, match="3 bytes came after reply 1"):
        ReplyReader(Request(1)).feed(b"".join(Reply(1, PeerSettings(False, True, True), 0, 0, 0).pack()) + b"xyz")


@pytest.mark.parametrize("size", [0, 15, 1025])
def test_a_request_of_another_size_is_not_packed(size: int) -> None:
    with pytest.raises(ConfigurationError, match=f"a body of {size} bytes is outside 16..1024"):
        Request(1, body_bytes=size)


@given(st.lists(st.integers(0, 20 * MS), max_size=60))
def test_an_allowance_never_gives_more_than_its_rate_after_the_first(gaps_ns: list[int]) -> None:
    allowance = Allowance(per_second=1000, most=5)
    now_ns = taken = 0
    for gap_ns in gaps_ns:
        now_ns += gap_ns
        taken += allowance.take(now_ns)
    assert min(len(gaps_ns), 5) <= taken <= 5 + now_ns // MS


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "'' is no HOST:PORT"),
        ("127.0.0.1", "is no HOST:PORT; give both"),
        (":80", "is no HOST:PORT"),
        ("127.0.0.1:", "is no HOST:PORT"),
        ("127.0.0.1:0", "port 0 is outside 1..65535"),
        ("127.0.0.1:70000", "port 70000 is outside 0..65535"),
        ("127.0.0.1:http", "the port 'http' is no number"),
        ("::1:80", "is no HOST:PORT"),
        ("fe80::1:80", "the links run over IPv4"),
    ],
)
def test_an_address_that_is_none_is_refused_in_a_sentence(text: str, sentence: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        parse_tcp_address(text)
    assert sentence in str(caught.value)


def test_a_port_in_use_is_named() -> None:
    with listen(Address("127.0.0.1", 0), backlog=1) as taken:
        address = Address(*taken.getsockname())
        with pytest.raises(EndpointError, match=f"cannot listen at TCP {address}: Address already in use"):
            listen(address, backlog=1)
