"""Decoders: bytes in, a value or the one error of their kind out."""

from collections.abc import Callable
from functools import partial

from hil.runtime.pad_requests import BadRequest, PadRequest, read_request
from hil.values.errors import MalformedDatagram
from hil.values.fri import Release
from tests.fuzz import seeds
from tests.fuzz.target import Target, refusal
from transport.fri import FriCodec
from transport.kst import LineCutter, Refused, Request
from transport.kst import read_request as read_line
from transport.servo import ServoCodec
from transport.tcp import NotTheProbe, ProbeRefused, ReplyReader, Wishes, read_greeting
from transport.tcp import Request as ProbeRequest
from transport.tcp.messages import read_request as read_probe_request

_KEY = bytes(range(32))
_FRI = {release: FriCodec(release) for release in Release}
_PLAIN, _KEYED = ServoCodec(), ServoCodec(_KEY)


def _decodes(decode: Callable[[bytes], object], data: bytes) -> None:
    assert refusal(partial(decode, data), MalformedDatagram).isprintable()


def _fri(data: bytes) -> None:
    for codec in _FRI.values():
        _decodes(codec.decode_command, data)
        _decodes(codec.decode_monitoring, data)


def _servo(data: bytes) -> None:
    for codec in (_PLAIN, _KEYED):
        _decodes(codec.decode_from_client, data)
        _decodes(codec.decode_from_controller, data)


def _pad(data: bytes) -> None:
    request = read_request(data)
    assert isinstance(request, PadRequest | BadRequest)
    if isinstance(request, BadRequest):
        assert request.reason.isprintable()


def _kst(data: bytes) -> None:
    whole = LineCutter().feed(data)
    cutter = LineCutter()
    half = len(data) // 2
    assert cutter.feed(data[:half]) + cutter.feed(data[half:]) == whole
    assert len(cutter.open_line) <= 1024 + 3
    for line in whole:
        if line:
            request = read_line(line)
            assert isinstance(request, Request | Refused)
            if isinstance(request, Refused):
                assert request.sentence.isprintable()


def _probe(data: bytes) -> None:
    asked = ProbeRequest(1, Wishes.of(0), 16)
    for read in (read_greeting, read_probe_request, ReplyReader(asked).feed):
        assert refusal(partial(read, data), NotTheProbe, ProbeRefused).isprintable()


def _fri_seeds() -> list[bytes]:
    recorded = [
        payload
        for release in Release
        for from_controller in (False, True)
        for payload in seeds.recorded(release.value, from_controller=from_controller)[:8]
    ]
    return [*recorded, *seeds.payloads("fri-1.15-joint-position-5ms.pcapng")]


def _servo_seeds() -> list[bytes]:
    return list(seeds.payloads("smart-servo-2ms.pcapng"))


TARGETS = (
    Target("fri", "Any bytes are an FRI message of a release, or malformed in printable words.", _fri, _fri_seeds),
    Target("servo", "Any bytes are a packet of the servo link, or malformed in printable words.", _servo, _servo_seeds),
    Target(
        "pad",
        "Any line is a request of the operator's channel, or bad for a printable reason.",
        _pad,
        lambda: [b'{"do": "status"}', b'{"do": "push", "force_n": [1, 2, 3], "id": 7}', b'{"do": "io", "name": "a.b"}'],
    ),
    Target(
        "kst-lines",
        "KST lines do not depend on how TCP cut them; each is a request or refused in printable words.",
        _kst,
        partial(seeds.files, "kst/*.txt"),
    ),
    Target(
        "tcp-probe",
        "Any bytes are a message of the TCP responder, or none of it in printable words.",
        _probe,
        lambda: [b"HIL-TCP-PROBE 1 Linux fri-hil\n", ProbeRequest(1, Wishes.of(0), 16).pack()[0]],
    ),
)
