"""The recorder with its real child process: nothing that happens to the child reaches the loop that feeds it."""

import gc
import json
import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from hil.clock import elapsed_ns
from hil.values.errors import UsageError
from tests.support.events import until_dead, until_stopped, until_takes, until_written
from transport.capture.endpoints import MAX_PAYLOAD_BYTES
from transport.capture.errors import CaptureError
from transport.capture.link import CaptureSummary
from transport.capture.process import CaptureProcess
from transport.capture.reading import read_capture, read_section_comment
from transport.capture.records import CapturedDatagram

ROBOT, CLIENT = ("192.170.10.2", 30200), ("192.170.10.100", 30200)
AT = 1_795_322_450_887_916_123
ROOT = Path(__file__).parents[2]


def put_many(capture: CaptureProcess, packets: int, *, first: int = 0, size: int = 400) -> None:
    for i in range(first, first + packets):
        capture.put(AT + i, ROBOT, CLIENT, i.to_bytes(4, "little") + bytes(size - 4))


def numbers(path: Path) -> list[int]:
    return [int.from_bytes(one.payload[:4], "little") for one in read_capture(path)]


def catch_up(capture: CaptureProcess) -> None:
    """Hand over everything that is pending."""
    capture.flush()
    while capture._waiting:
        until_takes(capture._socket)
        capture.flush()


def open_descriptors() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def stop(pid: int) -> None:
    os.kill(pid, signal.SIGSTOP)
    until_stopped(pid)


def test_twenty_thousand_packets_arrive_in_order(tmp_path: Path) -> None:
    path = tmp_path / "run.pcapng"
    with CaptureProcess(path, comment='{"seed": 7}') as capture:
        for i in range(20_000):
            source, destination = (ROBOT, CLIENT) if i % 2 else (CLIENT, ROBOT)
            capture.put(AT + i, source, destination, i.to_bytes(4, "little") * (1 + i % 100))
            if i % 1000 == 0:
                catch_up(capture)
        summary = capture.close(timeout_s=30.0)
    assert summary == CaptureSummary(path, written=20_000, dropped=0, error=None)
    assert capture.dropped == 0
    assert read_section_comment(path) == '{"seed": 7}'
    read = list(read_capture(path))
    assert [int.from_bytes(one.payload[:4], "little") for one in read] == list(range(20_000))
    assert read[0] == CapturedDatagram(AT, CLIENT, ROBOT, bytes(4))
    assert read[9_001].at_unix_ns == AT + 9_001
    assert read[9_001].source == ROBOT


@pytest.mark.parametrize("payload", [b"", bytes(MAX_PAYLOAD_BYTES)])
def test_the_shortest_and_the_longest_payload_arrive(tmp_path: Path, payload: bytes) -> None:
    path = tmp_path / "run.pcapng"
    with CaptureProcess(path, comment="") as capture:
        for i in range(5):
            capture.put(i, ROBOT, CLIENT, payload)
    assert list(read_capture(path)) == [CapturedDatagram(i, ROBOT, CLIENT, payload) for i in range(5)]


def test_a_capture_of_nothing_is_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "run.pcapng"
    assert CaptureProcess(path, comment="nothing").close() == CaptureSummary(path, 0, 0, None)
    assert read_section_comment(path) == "nothing"
    assert list(read_capture(path)) == []


def test_an_older_capture_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "run.pcapng"
    path.write_bytes(bytes(100_000))
    with CaptureProcess(path, comment="") as capture:
        put_many(capture, 3)
    assert numbers(path) == [0, 1, 2]


def test_flushing_brings_packets_to_the_file_while_the_run_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "run.pcapng"
    with CaptureProcess(path, comment="") as capture:
        put_many(capture, 3)
        capture.flush()
        until_written(path, lambda: path.stat().st_size > 1000)
        assert numbers(path) == [0, 1, 2]


def test_what_a_writer_does_not_take_in_time_is_dropped_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "run.pcapng"
    capture = CaptureProcess(path, comment="")
    stop(capture._process.pid)
    started_ns = elapsed_ns()
    put_many(capture, 60_000)
    assert elapsed_ns() - started_ns < 5_000_000_000  # would be for ever if a single put waited
    assert 0 < capture.dropped < 60_000
    os.kill(capture._process.pid, signal.SIGCONT)
    summary = capture.close(timeout_s=30.0)
    assert summary.error is None
    assert summary.written + summary.dropped == 60_000
    assert capture.dropped == summary.dropped
    # What waited continues the file without a gap; only the newest gave way.
    assert numbers(path) == list(range(summary.written))


def test_recording_goes_on_after_an_overflow(tmp_path: Path) -> None:
    path = tmp_path / "run.pcapng"
    capture = CaptureProcess(path, comment="")
    stop(capture._process.pid)
    put_many(capture, 60_000)
    os.kill(capture._process.pid, signal.SIGCONT)
    catch_up(capture)
    dropped = capture.dropped
    assert dropped > 0
    put_many(capture, 10, first=60_000)
    assert capture.close(timeout_s=30.0) == CaptureSummary(path, 60_010 - dropped, dropped, None)
    assert numbers(path)[-10:] == list(range(60_000, 60_010))


def test_a_full_disk_is_reported_and_disturbs_nobody() -> None:
    capture = CaptureProcess(Path("/dev/full"), comment="")
    put_many(capture, 10_000)
    summary = capture.close()
    assert summary == CaptureSummary(
        Path("/dev/full"), 0, 10_000, "/dev/full cannot be written: No space left on device"
    )


def test_a_disk_that_fills_during_the_run_leaves_a_whole_file(tmp_path: Path) -> None:
    """A limit of the file size stands in for the disk: the write that meets it is cut short, as on a full disk."""
    path = tmp_path / "run.pcapng"
    capture = CaptureProcess(path, comment="")
    resource.prlimit(capture._process.pid, resource.RLIMIT_FSIZE, (100_000, 100_000))
    put_many(capture, 1000)
    summary = capture.close()
    assert summary.error == f"{path} cannot be written: File too large"
    assert 64 <= summary.written < 1000
    assert summary.written + summary.dropped == 1000
    assert numbers(path) == list(range(summary.written))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_the_writer_outlives_the_signals_of_a_terminal_from_its_birth(tmp_path: Path, number: int) -> None:
    path = tmp_path / "run.pcapng"
    capture = CaptureProcess(path, comment="")
    os.kill(capture._process.pid, number)  # its interpreter is still starting
    put_many(capture, 500)
    capture.flush()
    until_written(path, lambda: path.stat().st_size > 0)
    os.kill(capture._process.pid, number)
    put_many(capture, 500, first=500)
    assert capture.close() == CaptureSummary(path, 1000, 0, None)
    assert numbers(path) == list(range(1000))


def test_starting_a_capture_leaves_the_signals_of_the_parent_alone(tmp_path: Path) -> None:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, set())
    CaptureProcess(tmp_path / "run.pcapng", comment="").close()
    assert signal.pthread_sigmask(signal.SIG_BLOCK, set()) == before


def test_a_killed_writer_is_reported_and_every_packet_counted(tmp_path: Path) -> None:
    path = tmp_path / "run.pcapng"
    capture = CaptureProcess(path, comment="")
    put_many(capture, 1000)
    os.kill(capture._process.pid, signal.SIGKILL)
    until_dead(capture._process.pid)
    put_many(capture, 1000)
    assert capture.dropped >= 960  # of the second thousand all but what still waits for a batch to fill
    summary = capture.close()
    assert (summary.written, summary.dropped) == (0, 2000)
    assert summary.error == (
        "the capture process ended by signal 9 before its report; what the file holds is not confirmed"
    )


def test_a_writer_that_fails_by_itself_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("transport.capture.process._WRITER", "transport.capture.missing")
    capture = CaptureProcess(tmp_path / "run.pcapng", comment="")
    put_many(capture, 100)
    summary = capture.close()
    assert (summary.written, summary.dropped) == (0, 100)
    assert summary.error is not None
    assert "exit code 1" in summary.error
    assert "No module named transport.capture.missing" in summary.error


@pytest.mark.parametrize("packets", [10, 60_000])
def test_a_writer_that_does_not_end_is_killed_and_named(tmp_path: Path, packets: int) -> None:
    capture = CaptureProcess(tmp_path / "run.pcapng", comment="")
    stop(capture._process.pid)
    put_many(capture, packets)
    started_ns = elapsed_ns()
    summary = capture.close(timeout_s=0.2)
    assert elapsed_ns() - started_ns < 2_000_000_000
    assert (summary.written, summary.dropped) == (0, packets)
    assert summary.error is not None
    assert "not done within 0.2 s and was killed" in summary.error
    assert capture._process.returncode == -signal.SIGKILL


def test_the_death_of_the_parent_leaves_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "run.pcapng"
    program = (
        "import os, pathlib, signal, sys\n"
        "from transport.capture.process import CaptureProcess\n"
        "capture = CaptureProcess(pathlib.Path(sys.argv[1]), comment='c')\n"
        "for i in range(640): capture.put(i, ('10.0.0.1', 1), ('10.0.0.2', 2), i.to_bytes(4, 'little') * 50)\n"
        "print(capture._process.pid, flush=True)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    parent = subprocess.run([sys.executable, "-c", program, str(path)], cwd=ROOT, capture_output=True, check=False)
    assert parent.returncode == -signal.SIGKILL
    until_dead(int(parent.stdout))
    assert numbers(path) == list(range(640))


def test_a_process_forked_from_the_parent_does_not_keep_the_writer_alive(tmp_path: Path) -> None:
    capture = CaptureProcess(tmp_path / "run.pcapng", comment="")
    holder = os.dup(capture._socket.fileno())
    try:
        assert capture.close(timeout_s=10.0).error is None
    finally:
        os.close(holder)


def test_the_writer_is_found_from_any_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("json.py").write_text("raise SystemExit('a module of the user was imported')")
    with CaptureProcess(Path("run.pcapng"), comment="") as capture:
        put_many(capture, 3)
    assert capture.close().error is None
    assert numbers(tmp_path / "run.pcapng") == [0, 1, 2]


def test_the_writer_gives_way_to_the_loop(tmp_path: Path) -> None:
    path = tmp_path / "run.pcapng"
    with CaptureProcess(path, comment="") as capture:
        until_written(path, lambda: path.stat().st_size > 0)
        pid = capture._process.pid
        assert os.getpriority(os.PRIO_PROCESS, pid) == min(19, os.getpriority(os.PRIO_PROCESS, 0) + 10)
        assert os.sched_getscheduler(pid) == os.SCHED_OTHER


def test_a_path_that_cannot_be_created_fails_at_once(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="there is no folder"):
        CaptureProcess(tmp_path / "none" / "run.pcapng", comment="")
    with pytest.raises(CaptureError, match="cannot be created: Is a directory"):
        CaptureProcess(tmp_path, comment="")
    with pytest.raises(CaptureError, match="cannot be created: Not a directory"):
        CaptureProcess(Path("/dev/null/run.pcapng"), comment="")


def test_a_comment_that_does_not_fit_fails_before_the_file_is_touched(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="65535"):
        CaptureProcess(tmp_path / "run.pcapng", comment="x" * 65_536)
    assert list(tmp_path.iterdir()) == []


def test_the_longest_comment_arrives(tmp_path: Path) -> None:
    comment = json.dumps("x" * 65_533)
    CaptureProcess(tmp_path / "run.pcapng", comment=comment).close()
    assert read_section_comment(tmp_path / "run.pcapng") == comment


def test_a_process_that_cannot_be_started_is_a_capture_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    with pytest.raises(CaptureError, match="cannot be started"):
        CaptureProcess(tmp_path / "run.pcapng", comment="")
    gc.collect()


@pytest.mark.parametrize(
    ("at_unix_ns", "source", "size"),
    [(-1, ROBOT, 1), (1 << 64, ROBOT, 1), (0, ("robot", 1), 1), (0, ("", 1), 1), (0, ROBOT, MAX_PAYLOAD_BYTES + 1)],
)
def test_what_no_datagram_can_have_is_a_usage_error_and_not_recorded(
    tmp_path: Path, at_unix_ns: int, source: tuple[str, int], size: int
) -> None:
    with CaptureProcess(tmp_path / "run.pcapng", comment="") as capture:
        with pytest.raises(UsageError):
            capture.put(at_unix_ns, source, CLIENT, bytes(size))
        put_many(capture, 2)
    assert capture.close() == CaptureSummary(tmp_path / "run.pcapng", 2, 0, None)


def test_a_second_close_changes_nothing_and_later_packets_are_dropped(tmp_path: Path) -> None:
    capture = CaptureProcess(tmp_path / "run.pcapng", comment="")
    put_many(capture, 5)
    summary = capture.close()
    put_many(capture, 100)
    capture.flush()
    assert capture.dropped == 100
    assert capture.close() is summary


def test_nothing_is_left_open(tmp_path: Path) -> None:
    gc.collect()
    before = open_descriptors()
    for i in range(3):
        with CaptureProcess(tmp_path / f"{i}.pcapng", comment="") as capture:
            put_many(capture, 100)
    del capture
    gc.collect()  # a socket, pipe or process forgotten would warn here, and warnings are errors
    assert open_descriptors() == before
