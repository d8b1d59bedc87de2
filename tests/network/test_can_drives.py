"""Simulated drives and controller as two processes, over two pseudo terminals that speak slcan."""

import os
import pty
import select
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.support.cli import cli
from tests.support.processes import finish, hil, own_host, wait_for_line

pytestmark = pytest.mark.skipif(find_spec("serial") is None, reason="slcan needs pyserial: pip install 'fri-hil[can]'")


@contextmanager
def null_modem() -> Iterator[tuple[str, str]]:
    """Return two terminals; what is written into one comes out of the other."""
    (a, a_end), (b, b_end) = pty.openpty(), pty.openpty()
    stop_out, stop_in = os.pipe()
    for end in (a_end, b_end):
        tty.setraw(end)
    for end in (a, b):
        os.set_blocking(end, False)

    def carry() -> None:
        while True:
            ready, _, _ = select.select([a, b, stop_out], [], [])
            if stop_out in ready:
                return
            for end in ready:
                # What nobody reads is lost, as on any wire.
                with suppress(BlockingIOError):
                    os.write(b if end == a else a, os.read(end, 4096))

    thread = threading.Thread(target=carry)
    thread.start()
    try:
        yield os.ttyname(a_end), os.ttyname(b_end)
    finally:
        os.write(stop_in, b"x")
        thread.join()
        for end in (a, a_end, b, b_end, stop_out, stop_in):
            os.close(end)


@pytest.mark.alone
def test_drives_in_another_process_are_set_up_and_their_end_stops_the_arm() -> None:
    """Set up by SDO, and answering; how well a terminal in Python keeps the cycle is its own affair."""
    with null_modem() as (theirs, ours):
        drives = hil("can-drives", "--interface", "slcan", "--channel", theirs, "--cycle", 5)
        wait_for_line(drives, "seven drives are on the bus")
        controller = hil(
            "run", "--backend", "can402", "-o", "interface=slcan", "-o", f"channel={ours}", "-o", "lost_after=40",
            "--cycle", 5, "--fri-client", "off", "--progress", 0, "--duration", 20,
        )  # fmt: skip
        wait_for_line(controller, "drives TRANSITIONING")
        ended = finish(drives, interrupt=True)
        wait_for_line(controller, "stop of category 0")
        assert finish(controller, interrupt=True).code == 0
    assert ended.code == 0, ended.err
    assert "simulated drives" in ended.out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--interface", "virtual", "--channel", "x"), "python-can's virtual bus lives inside one process"),
        (("--interface", "slcan", "--channel", "/dev/none"), "cannot open the CAN bus '/dev/none'"),
        (("--interface", "slcan", "--channel", "x", "--fault", "9:lost"), "with one of the nodes 1, 2, 3, 4, 5, 6, 7"),
        (("--interface", "slcan", "--channel", "x", "--fault", "4:lots"), "unknown fault 'lots'"),
        (("--interface", "slcan", "--channel", "x", "--nodes", "1,x"), "7 numbers are needed"),
    ],
)
def test_what_cannot_be_is_refused(arguments: tuple[str, ...], sentence: str) -> None:
    ended = finish(hil("can-drives", *arguments))
    assert ended.code == 2
    assert sentence in ended.err


def test_a_recording_of_drives_is_not_replayed_and_nothing_but_a_run_moves_real_ones(tmp_path: Path) -> None:
    capture = tmp_path / "run.pcapng"
    run = hil(
        "run", "--backend", "can402", "-o", "simulated=true", "--cycle", 4, "--duration", 0.5, "--capture", capture,
        "--fri-client", own_host(), "--send-period", 4,
    )  # fmt: skip
    assert finish(run).code == 0
    replayed = cli("replay", capture)
    assert replayed.code == 2
    assert "was recorded on the backend can402: what came from its robot side is not in the recording" in replayed.err
    stepped = cli("step-response", "--backend", "can402", "-o", tmp_path / "out")
    assert stepped.code == 2
    assert "the backend can402 moves real drives, and only hil run may" in stepped.err
