"""The recorded client traffic in ``../shared/captures``."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import dpkt

from hil.values.fri import Release

FOLDER = Path(__file__).parents[2].parent / "shared" / "captures"
CONTROLLER_HOST = bytes([192, 170, 10, 2])
_HEADERS_BYTES = 42


class Recorded(NamedTuple):
    """One recorded datagram."""

    from_controller: bool
    payload: bytes


def files() -> list[Path]:
    """Return all capture files."""
    return sorted(FOLDER.glob("*.pcapng"))


def release_of(path: Path) -> Release:
    """Return the release a capture was taken with, from its name."""
    return Release(path.name.split("-")[1])


def datagrams(path: Path) -> Iterator[Recorded]:
    """Yield all datagrams of a capture in order."""
    with path.open("rb") as stream:
        for _, frame in dpkt.pcapng.Reader(stream):
            yield Recorded(frame[26:30] == CONTROLLER_HOST, frame[_HEADERS_BYTES:])
