"""A second run with what the first one has: one sentence that says what is taken, by whom, and what to do instead."""

import os
import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from hil.runtime.lifetime import claimed_result_file, write_result_file
from hil.runtime.pad_socket import PadSocket
from hil.values.errors import ConfigurationError
from hil.values.link import Address
from tests.support.cli import cli
from tests.support.processes import own_host
from transport.capture.batches import Ring
from transport.capture.errors import CaptureError
from transport.capture.parts import part_path
from transport.capture.process import CaptureProcess, create_file
from transport.capture.reading import read_capture
from transport.holders import held_by

ME = f"process {os.getpid()} ("


def run_beside(*options: object) -> str:
    """Start a run that must not start; return the sentence it ends with."""
    links = {"--fri-client": "off", "--servo": f"{own_host()}:0", "--pad": "off"}
    given = [*options, *(word for link in links if link not in options for word in (link, links[link]))]
    ended = cli("run", "--backend", "ideal", "--duration", 1, *given)
    assert ended.code == 2, ended.err
    [sentence] = ended.err.strip().splitlines()
    return sentence


def test_a_capture_that_another_run_writes(tmp_path: Path) -> None:
    path = tmp_path / "run.pcapng"
    source, destination = ("192.170.10.2", 30200), ("192.170.10.100", 30200)
    with CaptureProcess(path, comment="") as first:
        first.put(1, source, destination, b"before")
        first.flush()
        sentence = run_beside("--capture", path)
        assert f"hil: capture {path}: " in sentence
        assert "process " in sentence
        assert sentence.endswith("records to it; choose another file")
        with pytest.raises(CaptureError, match="records to it"):
            create_file(path, keep=True)  # as hil capture start does
        first.put(2, source, destination, b"after")
    assert [one.payload for one in read_capture(path)] == [b"before", b"after"]
    os.close(create_file(path))  # and now it is free


def test_a_part_of_a_ring_that_another_run_writes(tmp_path: Path) -> None:
    path = tmp_path / "run.pcapng"
    part_fd = create_file(part_path(path, 2))
    try:
        with CaptureProcess(path, comment="", ring=Ring(2, 20_000)) as capture:
            for number in range(200):
                capture.put(number, ("192.170.10.2", 30200), ("192.170.10.100", 30200), bytes(100))
            told = capture.close()
    finally:
        os.close(part_fd)
    assert told.error is not None
    assert "records to run" in told.error
    assert len(list(read_capture(path))) == told.written > 0
    assert not part_path(path, 2).stat().st_size


def test_a_status_file_that_another_run_will_write(tmp_path: Path) -> None:
    status = tmp_path / "status.json"
    with claimed_result_file(status):
        sentence = run_beside("--status-json", status)
        assert sentence.startswith(f"hil: cannot write {status}: {ME}")
        assert sentence.endswith("writes its results there; choose another file")
        write_result_file(status, {"first": True})
    assert '"first": true' in status.read_text()


def test_a_status_file_without_a_result_is_not_left_and_one_from_before_stays(tmp_path: Path) -> None:
    new, old = tmp_path / "new.json", tmp_path / "old.json"
    old.write_text("{}")
    for file in (new, old):
        with pytest.raises(ConfigurationError, match="cannot start"), claimed_result_file(file):
            raise ConfigurationError("cannot start")
    assert (new.exists(), old.read_text()) == (False, "{}")
    with claimed_result_file(Path(os.devnull)), claimed_result_file(Path(os.devnull)):
        pass  # a device is nobody's


def test_a_pad_that_another_controller_listens_at(tmp_path: Path) -> None:
    place = str(tmp_path / "pad.sock")
    with closing(PadSocket(place)) as first:
        first.link.listen(1)
        sentence = run_beside("--pad", place)
        assert sentence.startswith(f"hil: a controller listens at {place} already, {ME}")
        assert sentence.endswith("; give --pad another path")
        assert first.path.exists()


@contextmanager
def bound(kind: socket.SocketKind, host: str) -> Iterator[str]:
    """A socket of somebody else at a free port of ``host``."""
    with closing(socket.socket(socket.AF_INET, kind)) as taken:
        taken.bind((host, 0))
        if kind is socket.SOCK_STREAM:
            taken.listen(1)
        yield "{}:{}".format(own_host() if host == "0.0.0.0" else host, taken.getsockname()[1])  # noqa: S104


@pytest.mark.parametrize("host", [own_host(), "0.0.0.0"], ids=["the address", "every address"])  # noqa: S104
@pytest.mark.parametrize(
    ("option", "kind"),
    [
        ("--servo", socket.SOCK_DGRAM),
        ("--fri-bind", socket.SOCK_DGRAM),
        ("--kst", socket.SOCK_STREAM),
        ("--tcp-probe", socket.SOCK_STREAM),
    ],
)
def test_a_port_that_is_taken_says_by_whom(option: str, kind: socket.SocketKind, host: str) -> None:
    with bound(kind, host) as address:
        client = ("--fri-client", own_host()) if option == "--fri-bind" else ()
        sentence = run_beside(option, address, *client)
    assert f" {address}: Address already in use; " in sentence
    assert "choose another" in sentence
    assert f"; {ME}" in sentence
    assert sentence.endswith(" has it")


def test_nobody_is_named_for_a_port_that_is_free() -> None:
    with bound(socket.SOCK_DGRAM, host := own_host()) as address:
        port = int(address.rpartition(":")[2])
        assert held_by("udp", Address(host, port)).startswith(f"; {ME}")
        assert not held_by("udp", Address(own_host(), port))
        assert not held_by("tcp", Address(host, port))
