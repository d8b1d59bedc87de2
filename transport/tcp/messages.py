"""The messages of the probe: values, their bytes, and readers that take bytes as they come."""

import struct
from dataclasses import dataclass
from typing import Final

from hil.values.errors import ConfigurationError, PeerError

HEAD_BYTES: Final = 16
BODY_LEAST_BYTES: Final = 16
BODY_MOST_BYTES: Final = 1024
LINE_MOST_BYTES: Final = 200
NANOSECONDS_MOST: Final = 2**63 - 1

_GREETING = b"HIL-TCP-PROBE 1 "
_REFUSAL = b"HIL-TCP-PROBE refused: "
_REQUEST_MAGIC = b"HTPq"
_REPLY_MAGIC = b"HTPr"
_REQUEST = struct.Struct("!4sIB3xH2x")
_REPLY = struct.Struct("!4sIB3xHH")
_DURATIONS = struct.Struct("!QQ")
_KEEP, _YES, _NO = range(3)
_BITS: Final = {None: _KEEP, True: _YES, False: _NO}
_MEANING: Final = {bits: meaning for meaning, bits in _BITS.items()}


class NotTheProbe(PeerError):
    """The other side speaks, but not this protocol."""


class ProbeRefused(PeerError):
    """The other side ended the connection with a sentence."""


@dataclass(frozen=True, slots=True)
class Wishes:
    """What a request asks of the responder from now on; None: as it is."""

    two_writes: bool | None = None
    no_delay: bool | None = None
    quick_ack: bool | None = None

    def bits(self) -> int:
        """Return them as they are sent."""
        return _BITS[self.two_writes] | _BITS[self.no_delay] << 2 | _BITS[self.quick_ack] << 4

    @classmethod
    def of(cls, bits: int) -> "Wishes":
        """Return what ``bits`` ask for; raise :class:`NotTheProbe`."""
        fields = bits & 3, bits >> 2 & 3, bits >> 4 & 3
        if bits >> 6 or any(field not in _MEANING for field in fields):
            raise NotTheProbe(f"wishes {bits:#04x} are none; three fields of 0, 1 or 2 are")
        return cls(*(_MEANING[field] for field in fields))


@dataclass(frozen=True, slots=True)
class PeerSettings:
    """How the responder's side of a connection is."""

    two_writes: bool
    no_delay: bool
    quick_ack: bool

    def after(self, wishes: Wishes) -> "PeerSettings":
        """Return them with the wishes fulfilled."""
        return PeerSettings(
            self.two_writes if wishes.two_writes is None else wishes.two_writes,
            self.no_delay if wishes.no_delay is None else wishes.no_delay,
            self.quick_ack if wishes.quick_ack is None else wishes.quick_ack,
        )

    def bits(self) -> int:
        """Return them as they are sent."""
        return Wishes(self.two_writes, self.no_delay, self.quick_ack).bits()


@dataclass(frozen=True, slots=True)
class Greeting:
    """What a responder says first: the system it runs on, and its software."""

    system: str
    software: str

    def pack(self) -> bytes:
        """Return it as a line."""
        return _line(_GREETING, f"{_word(self.system)} {_word(self.software)}")


@dataclass(frozen=True, slots=True)
class Request:
    """One request; ``body_bytes`` follow its head."""

    sequence: int
    wishes: Wishes = Wishes()
    body_bytes: int = BODY_LEAST_BYTES

    def __post_init__(self) -> None:
        if not BODY_LEAST_BYTES <= self.body_bytes <= BODY_MOST_BYTES:
            raise ConfigurationError(
                f"a body of {self.body_bytes} bytes is outside {BODY_LEAST_BYTES}..{BODY_MOST_BYTES}"
            )

    def pack(self) -> tuple[bytes, bytes]:
        """Return its head and its body, to be written as one or as two parts."""
        head = _REQUEST.pack(_REQUEST_MAGIC, self.sequence & 0xFFFFFFFF, self.wishes.bits(), self.body_bytes)
        return head, bytes(self.body_bytes)


@dataclass(frozen=True, slots=True)
class Reply:
    """One reply, and what the responder measured by its own clock."""

    sequence: int
    settings: PeerSettings
    retransmissions: int
    parts_apart_ns: int
    """From the first part of the request to its last."""
    thought_ns: int
    """From there to the reply."""
    body_bytes: int = BODY_LEAST_BYTES

    def pack(self) -> tuple[bytes, bytes]:
        """Return its head and its body."""
        head = _REPLY.pack(
            _REPLY_MAGIC,
            self.sequence & 0xFFFFFFFF,
            self.settings.bits(),
            self.body_bytes,
            self.retransmissions & 0xFFFF,
        )
        durations = _DURATIONS.pack(_bounded(self.parts_apart_ns), _bounded(self.thought_ns))
        return head, durations.ljust(self.body_bytes, b"\0")


def pack_refusal(sentence: str) -> bytes:
    """Return the line that ends a connection."""
    return _line(_REFUSAL, sentence)


def read_greeting(data: bytes) -> Greeting | None:
    """Return the greeting in ``data``, None while it is not complete; raise :class:`NotTheProbe`, ProbeRefused."""
    _raise_refusal(data)
    if not _begins(data, _GREETING) and not _begins(data, _REFUSAL):
        raise NotTheProbe(f"it begins with {shown(data)}, where {_GREETING.decode()!r} was expected")
    line, end, rest = data.partition(b"\n")
    if not end:
        if len(data) >= LINE_MOST_BYTES:
            raise NotTheProbe(f"its first line is longer than {LINE_MOST_BYTES} bytes")
        return None
    words = line[len(_GREETING) :].decode("ascii", "replace").split()
    if len(words) != 2 or rest:
        raise NotTheProbe(f"its first line is {shown(data)}; a system and a software were expected")
    return Greeting(*words)


def read_request(data: bytes | bytearray) -> Request | None:
    """Return the request that ``data`` begins with, None while its head is not complete; raise NotTheProbe."""
    if not _begins(bytes(data[:4]), _REQUEST_MAGIC):
        raise NotTheProbe(f"{shown(bytes(data[:16]))} is no request; it would begin with {_REQUEST_MAGIC.decode()}")
    if len(data) < HEAD_BYTES:
        return None
    _, sequence, wishes, body_bytes = _REQUEST.unpack(bytes(data[:HEAD_BYTES]))
    if not BODY_LEAST_BYTES <= body_bytes <= BODY_MOST_BYTES:
        raise NotTheProbe(f"a body of {body_bytes} bytes is outside {BODY_LEAST_BYTES}..{BODY_MOST_BYTES}")
    return Request(sequence, Wishes.of(wishes), body_bytes)


class ReplyReader:
    """Takes the bytes of one reply as they come."""

    def __init__(self, request: Request) -> None:
        self._request = request
        self._data = bytearray()

    def feed(self, data: bytes) -> Reply | None:
        """Take ``data``; return the reply once it is complete; raise :class:`NotTheProbe`, :class:`ProbeRefused`."""
        self._data += data
        whole = bytes(self._data)
        _raise_refusal(whole)
        if _begins(whole, _REFUSAL) and len(whole) < LINE_MOST_BYTES:
            return None
        if not _begins(whole[:4], _REPLY_MAGIC):
            raise NotTheProbe(f"{shown(whole)} is no reply; it would begin with {_REPLY_MAGIC.decode()}")
        if len(whole) < HEAD_BYTES:
            return None
        _, sequence, state, body_bytes, retransmissions = _REPLY.unpack(whole[:HEAD_BYTES])
        if (sequence, body_bytes) != (self._request.sequence, self._request.body_bytes):
            raise NotTheProbe(
                f"reply {sequence} of {body_bytes} bytes came, where {self._request.sequence} of "
                f"{self._request.body_bytes} bytes was asked for"
            )
        if len(whole) > HEAD_BYTES + body_bytes:
            raise NotTheProbe(f"{len(whole) - HEAD_BYTES - body_bytes} bytes came after reply {sequence}")
        settings = _settings(state)
        if len(whole) < HEAD_BYTES + body_bytes:
            return None
        apart_ns, thought_ns = _DURATIONS.unpack(whole[HEAD_BYTES : HEAD_BYTES + _DURATIONS.size])
        if max(apart_ns, thought_ns) > NANOSECONDS_MOST:
            raise NotTheProbe(f"durations of {apart_ns} and {thought_ns} ns are none")
        return Reply(sequence, settings, retransmissions, apart_ns, thought_ns, body_bytes)


def shown(data: bytes, most: int = 32) -> str:
    """Return foreign bytes as they can be printed."""
    text = repr(bytes(data[:most]))[1:]
    return f"{text}..." if len(data) > most else text


def _settings(bits: int) -> PeerSettings:
    wishes = Wishes.of(bits)
    two_writes, no_delay, quick_ack = wishes.two_writes, wishes.no_delay, wishes.quick_ack
    if two_writes is None or no_delay is None or quick_ack is None:
        raise NotTheProbe(f"state {bits:#04x} leaves open how the other side's connection is")
    return PeerSettings(two_writes, no_delay, quick_ack)


def _raise_refusal(data: bytes) -> None:
    if data.startswith(_REFUSAL) and b"\n" in data[:LINE_MOST_BYTES]:
        sentence = data[len(_REFUSAL) :].partition(b"\n")[0].decode("ascii", "replace")
        raise ProbeRefused("".join(letter if letter.isprintable() else "?" for letter in sentence))


def _begins(data: bytes, word: bytes) -> bool:
    return data.startswith(word) or word.startswith(data)


def _line(begin: bytes, text: str) -> bytes:
    clean = "".join(letter if letter.isprintable() else "?" for letter in text).encode("ascii", "replace")
    return (begin + clean)[: LINE_MOST_BYTES - 1] + b"\n"


def _word(text: str) -> str:
    return "_".join(text.split())[:60] or "unknown"


def _bounded(duration_ns: int) -> int:
    return min(max(duration_ns, 0), NANOSECONDS_MOST)
