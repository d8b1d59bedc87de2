"""What surrounds a packet: one byte of framing and, with a pre-shared key, a tag; and the files keys are kept in.

The tag is keyed BLAKE2b of all bytes before it, personalised for the direction, so that a packet cannot be sent back
to where it came from. The framing byte says whether there is a tag, so that an end that has a key and one that has none
know each other for what they are.
"""

import hmac
import os
import re
import stat
from enum import Enum
from hashlib import blake2b
from pathlib import Path
from typing import Final

from hil.values.errors import ConfigurationError, MalformedDatagram
from hil.values.outcomes import Outcome
from hil.values.servo import MAX_SERVO_DATAGRAM_BYTES

MIN_KEY_BYTES: Final = 16
MAX_KEY_BYTES: Final = 64
NEW_KEY_BYTES: Final = 32
MAX_KEY_FILE_BYTES: Final = 1024
TAG_BYTES: Final = 16
SMALLEST_BYTES: Final = 5
"""Framing, and a header that has a version and nothing else."""
_BARE: Final = b"\x53"
_TAGGED: Final = b"\x54"
_OTHERS: Final = stat.S_IRWXG | stat.S_IRWXO
_HEXADECIMAL: Final = re.compile(rb"[0-9a-fA-F]+")


class Direction(Enum):
    """Which way packets go; the value makes the tags of the two ways different."""

    FROM_CLIENT = b"hil servo to hil"
    FROM_CONTROLLER = b"hil servo to app"


class Envelope:
    """Framing and tag of one ``direction``; ``key`` has 16..64 bytes, None for no tags."""

    def __init__(self, key: bytes | None, direction: Direction) -> None:
        if key is not None and not MIN_KEY_BYTES <= len(key) <= MAX_KEY_BYTES:
            raise ConfigurationError(f"a key of {len(key)} bytes; {MIN_KEY_BYTES}..{MAX_KEY_BYTES} are needed")
        self._keyed = None if key is None else blake2b(key=key, digest_size=TAG_BYTES, person=direction.value)
        self.overhead_bytes = 1 if key is None else 1 + TAG_BYTES
        """What it adds to a packet."""

    def wrap(self, packet: bytes) -> bytes:
        """Return the datagram of a packet."""
        if self._keyed is None:
            return _BARE + packet
        framed = _TAGGED + packet
        return framed + _tag(self._keyed, framed)

    def unwrap(self, datagram: bytes) -> bytes:
        """Return the packet in a datagram; raise :class:`MalformedDatagram` with what is wrong around it."""
        size = len(datagram)
        if size > MAX_SERVO_DATAGRAM_BYTES:
            raise MalformedDatagram(Outcome.TOO_LONG, f"{size} bytes, at most {MAX_SERVO_DATAGRAM_BYTES} are allowed")
        if size < SMALLEST_BYTES:
            raise MalformedDatagram(Outcome.TOO_SHORT, f"{size} bytes, the smallest packet has {SMALLEST_BYTES}")
        framing = datagram[:1]
        if self._keyed is not None:
            return self._checked(self._keyed, datagram, framing)
        if framing == _BARE:
            return datagram[1:]
        if framing == _TAGGED:
            raise MalformedDatagram(Outcome.UNAUTHENTICATED, "a tag, but there is no pre-shared key on this side")
        raise MalformedDatagram(Outcome.UNDECODABLE, f"{size} bytes that begin with 0x{framing.hex()} are no packet")

    def _checked(self, keyed: blake2b, datagram: bytes, framing: bytes) -> bytes:
        if framing != _TAGGED:
            raise MalformedDatagram(Outcome.UNAUTHENTICATED, "no tag, but there is a pre-shared key on this side")
        if not hmac.compare_digest(_tag(keyed, datagram[:-TAG_BYTES]), datagram[-TAG_BYTES:]):
            raise MalformedDatagram(Outcome.UNAUTHENTICATED, "the tag is not what the pre-shared key gives")
        return datagram[1:-TAG_BYTES]


def _tag(keyed: blake2b, framed: bytes) -> bytes:
    # A copy of the keyed state: digesting the key again for each datagram would cost as much as a small packet does.
    digest = keyed.copy()
    digest.update(framed)
    return digest.digest()


def load_key(path: Path | str) -> bytes:
    """Return the key in a file: hexadecimal digits, or any other text as it is, without white space around it.

    Raises :class:`ConfigurationError` in one sentence for a file that cannot be read, that others may read or change
    (POSIX), or that has no key of 16..64 bytes.
    """
    try:
        with Path(path).open("rb") as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            content = file.read(MAX_KEY_FILE_BYTES + 1)
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"cannot read key file {path}: {_why(error)}") from error
    if os.name == "posix" and mode & _OTHERS:
        raise ConfigurationError(
            f"key file {path} has mode {mode:04o}, so that others may read or change it: chmod 600 {path}"
        )
    if len(content) > MAX_KEY_FILE_BYTES:
        raise ConfigurationError(f"key file {path} has more than {MAX_KEY_FILE_BYTES} bytes: that is no key")
    return _key(content.strip(), path)


def write_key(path: Path | str) -> None:
    """Write a new random key into a new file that only its owner may read; never overwrites.

    Raises :class:`ConfigurationError` in one sentence.
    """
    try:
        with open(path, "x", encoding="ascii", opener=_open_private) as file:
            file.write(os.urandom(NEW_KEY_BYTES).hex() + "\n")
    except FileExistsError:
        raise ConfigurationError(f"{path} exists already; a key file is never overwritten") from None
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"cannot write key file {path}: {_why(error)}") from error


def _key(content: bytes, path: Path | str) -> bytes:
    digits = _HEXADECIMAL.fullmatch(content) is not None
    if digits and len(content) % 2:
        raise ConfigurationError(f"key file {path} has {len(content)} hexadecimal digits: an even number is needed")
    key = bytes.fromhex(content.decode("ascii")) if digits else content
    if not MIN_KEY_BYTES <= len(key) <= MAX_KEY_BYTES:
        how = f" in {len(content)} hexadecimal digits" if digits else ""
        raise ConfigurationError(
            f"key file {path} has a key of {len(key)} bytes{how}; {MIN_KEY_BYTES}..{MAX_KEY_BYTES} are needed"
        )
    return key


def _open_private(path: str, flags: int) -> int:
    return os.open(path, flags, 0o600)


def _why(error: OSError | ValueError) -> str:
    return (isinstance(error, OSError) and error.strerror) or str(error)
