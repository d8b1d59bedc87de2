"""Files that somebody else wrote: captures and station files."""

import tempfile
from functools import partial
from pathlib import Path

from hil.config.station import load_station
from hil.config.template import TEMPLATE
from hil.values.errors import ConfigurationError
from tests.fuzz import seeds
from tests.fuzz.target import Target, refusal
from transport.capture.errors import CaptureError
from transport.capture.reading import read_capture, read_records, read_section_comment

_FOLDER = tempfile.TemporaryDirectory(prefix="hil-fuzz-")


def _capture(data: bytes) -> None:
    file = Path(_FOLDER.name, "x.pcapng")
    file.write_bytes(data)
    for read in (_all_datagrams, _all_records, read_section_comment):
        said = refusal(partial(read, file), CaptureError)
        assert not said or str(file) in said


def _all_datagrams(file: Path) -> list[object]:
    return list(read_capture(file))


def _all_records(file: Path) -> list[object]:
    return list(read_records(file))


def _station(data: bytes) -> None:
    file = Path(_FOLDER.name, "x.toml")
    file.write_bytes(data)
    said = refusal(partial(load_station, file), ConfigurationError)
    assert not said or str(file) in said


TARGETS = (
    Target(
        "capture",
        "Any file is a capture, or an error that names it.",
        _capture,
        lambda: [*seeds.files("*.pcapng"), *seeds.files("tcp/*.pcapng")],
        longest_bytes=16384,
    ),
    Target(
        "station",
        "Any file is a station, or an error that names it.",
        _station,
        lambda: [TEMPLATE.encode(), b"[[robot]]\nkst = {}\nservo = {}\n"],
    ),
)
