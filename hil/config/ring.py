"""``capture_ring``: captures of bounded size, ``FILESxSIZE`` such as ``10x100MB``."""

import re
from typing import Final, NamedTuple

from hil.values.errors import ConfigurationError

_RING: Final = re.compile(r"(?P<files>\d{1,6})x(?P<size>\d{1,9})(?P<unit>[kMG]B)")
_UNITS: Final = {"kB": 1000, "MB": 1000**2, "GB": 1000**3}
MIN_FILES: Final = 2
MIN_FILE_BYTES: Final = 100_000


class RingSize(NamedTuple):
    """The newest ``files`` files of about ``file_bytes`` each are kept."""

    files: int
    file_bytes: int


def parse_ring(text: str) -> RingSize:
    """Return what ``FILESxSIZE`` says; raise :class:`ConfigurationError`."""
    found = _RING.fullmatch(text)
    if found is None:
        raise ConfigurationError(f"a capture ring of {text!r}; valid is FILESxSIZE with kB, MB or GB, such as 10x100MB")
    ring = RingSize(int(found["files"]), int(found["size"]) * _UNITS[found["unit"]])
    if ring.files < MIN_FILES or ring.file_bytes < MIN_FILE_BYTES:
        raise ConfigurationError(f"a capture ring of {text!r}; at least {MIN_FILES} files of 100 kB are needed")
    return ring
