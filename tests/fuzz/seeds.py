"""Inputs to begin with: recorded traffic of this repository, and of ``../shared`` where it is there."""

from functools import cache
from pathlib import Path
from typing import Final

from tests.support import captures
from transport.capture.reading import read_capture

MOST: Final = 40
_DATA: Final = Path(__file__).parents[1] / "data"


@cache
def payloads(name: str) -> tuple[bytes, ...]:
    """Return different datagrams of a recording in ``tests/data``."""
    found = dict.fromkeys(record.payload for record in read_capture(_DATA / name))
    return _spread(list(found))


@cache
def recorded(release: str, *, from_controller: bool) -> tuple[bytes, ...]:
    """Return different datagrams of recorded client traffic of a release."""
    found: dict[bytes, None] = {}
    for file in captures.files():
        if captures.release_of(file).value == release:
            found |= {one.payload: None for one in captures.datagrams(file) if one.from_controller is from_controller}
    return _spread(list(found))


def files(pattern: str) -> list[bytes]:
    """Return the files of ``tests/data`` that match, each cut to its first kilobytes."""
    return [file.read_bytes()[:8192] for file in sorted(_DATA.glob(pattern))]


def _spread(found: list[bytes]) -> tuple[bytes, ...]:
    step = max(1, len(found) // MOST)
    return tuple(found[::step][:MOST])
