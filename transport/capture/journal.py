"""What a controller's shell told its core beside datagrams: the rest of the inputs that a replay needs.

An entry is a head (kind, number of the robot in the run, size of what follows) and its content, little-endian. A
sequence of entries may be cut between any two of them. Times are nanoseconds on the robot's core axis.
"""

import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from enum import IntEnum
from typing import Final, NamedTuple, TypeAlias

from hil.values.tuples import new_tuple

_HEAD: Final = struct.Struct("<BBH")
_TICK: Final = struct.Struct("<qqqI")
_WHOLE_TICK: Final = struct.Struct("<BBHqqqI")
_TIME: Final = struct.Struct("<q")
_WRAPPED_TIME: Final = struct.Struct("<Q")
_MASK: Final = (1 << 64) - 1
_COUNT: Final = struct.Struct("<Q")
MAX_TEXT_BYTES: Final = 4096


class JournalError(ValueError):
    """Bytes that are no entry, or an entry that cannot be."""


class EntryKind(IntEnum):
    """Numbers are those in the file."""

    TICK = 1
    ACTION = 2
    CLOSE = 3
    FAILED = 4
    LOST = 5
    END = 6


class TickEntry(NamedTuple):
    """A control cycle ran; what it sent comes behind this entry."""

    robot: int
    due_ns: int
    """Its nominal time."""
    lateness_ns: int
    """How late it really began."""
    departed_ns: int
    """When what it sent left."""
    inputs_crc32: int
    """Of the datagrams taken since the cycle before, with their times: see :func:`inputs_crc32`."""


class ActionEntry(NamedTuple):
    """The operator did something; ``action`` is a request of the pad, as JSON."""

    robot: int
    at_ns: int
    action: str


class CloseEntry(NamedTuple):
    """The controller was asked to end."""

    robot: int
    at_ns: int


class FailedEntry(NamedTuple):
    """The robot side failed, and the sessions were ended at once."""

    robot: int
    at_ns: int
    reason: str


class LostEntry(NamedTuple):
    """So many records are missing here: the writer did not keep up."""

    records: int


class EndEntry(NamedTuple):
    """The recording ends here because it was ended, not because something broke."""


Entry: TypeAlias = TickEntry | ActionEntry | CloseEntry | FailedEntry | LostEntry | EndEntry


def inputs_crc32(payload: bytes, at_ns: int, before: int = 0) -> int:
    """Return the CRC-32 of the datagrams taken so far and this one, which arrived at ``at_ns``."""
    # A damaged time stamp may be of any size; of one that fits, these are the bytes it has as a signed number.
    return zlib.crc32(payload, zlib.crc32(_WRAPPED_TIME.pack(at_ns & _MASK), before))


def tick_entry(robot: int, *, due_ns: int, lateness_ns: int, departed_ns: int, inputs_crc32: int) -> bytes:
    """Return the bytes of a :class:`TickEntry`."""
    return _HEAD.pack(EntryKind.TICK, robot, _TICK.size) + _TICK.pack(due_ns, lateness_ns, departed_ns, inputs_crc32)


def encode_entry(entry: Entry) -> bytes:
    """Return the bytes of an entry; texts are cut at :data:`MAX_TEXT_BYTES`."""
    match entry:
        case TickEntry():
            return _entry(EntryKind.TICK, entry.robot, _TICK.pack(*entry[1:]))
        case ActionEntry(robot, at_ns, action):
            return _entry(EntryKind.ACTION, robot, _TIME.pack(at_ns) + action.encode())
        case CloseEntry(robot, at_ns):
            return _entry(EntryKind.CLOSE, robot, _TIME.pack(at_ns))
        case FailedEntry(robot, at_ns, reason):
            return _entry(EntryKind.FAILED, robot, _TIME.pack(at_ns) + _cut(reason))
        case LostEntry(records):
            return _entry(EntryKind.LOST, 0, _COUNT.pack(records))
        case EndEntry():
            return _entry(EntryKind.END, 0, b"")


def single_tick(data: bytes) -> TickEntry | None:
    """Return the entry of a cycle if ``data`` is that and nothing else, as it nearly always is; a fifth of the time."""
    if len(data) != _WHOLE_TICK.size or data[0] != EntryKind.TICK:
        return None
    _, robot, _, due_ns, lateness_ns, departed_ns, crc32 = _WHOLE_TICK.unpack(data)
    tick: TickEntry = new_tuple(TickEntry, (robot, due_ns, lateness_ns, departed_ns, crc32))
    return tick


def read_entries(data: bytes) -> Iterator[Entry]:
    """Yield the entries of ``data``; raise :class:`JournalError` where it is none. Unknown kinds are passed over."""
    at = 0
    while at < len(data):
        if at + _HEAD.size > len(data):
            raise JournalError(f"{len(data) - at} bytes are no head of an entry")
        kind, robot, size = _HEAD.unpack_from(data, at)
        at += _HEAD.size
        content = data[at : at + size]
        if len(content) < size:
            raise JournalError(f"an entry of {size} bytes has only {len(content)}")
        at += size
        entry = _read(kind, robot, content)
        if entry is not None:
            yield entry


def _entry(kind: EntryKind, robot: int, content: bytes) -> bytes:
    return _HEAD.pack(kind, robot, len(content)) + content


def _cut(text: str) -> bytes:
    return text.encode()[:MAX_TEXT_BYTES].decode(errors="ignore").encode()


def _read(kind: int, robot: int, content: bytes) -> Entry | None:
    read = _READERS.get(kind)
    try:
        return None if read is None else read(robot, content)
    except (struct.error, UnicodeDecodeError) as error:
        raise JournalError(f"an entry of kind {kind} is damaged: {error}") from error


def _time(content: bytes) -> int:
    at_ns: int = _TIME.unpack_from(content)[0]
    return at_ns


def _text(content: bytes) -> str:
    return content[_TIME.size :].decode()


_READERS: Final[Mapping[int, Callable[[int, bytes], Entry]]] = {
    EntryKind.TICK: lambda robot, content: TickEntry(robot, *_TICK.unpack(content)),
    EntryKind.ACTION: lambda robot, content: ActionEntry(robot, _time(content), _text(content)),
    EntryKind.CLOSE: lambda robot, content: CloseEntry(robot, *_TIME.unpack(content)),
    EntryKind.FAILED: lambda robot, content: FailedEntry(robot, _time(content), _text(content)),
    EntryKind.LOST: lambda _, content: LostEntry(*_COUNT.unpack(content)),
    EntryKind.END: lambda *_: EndEntry(),
}
