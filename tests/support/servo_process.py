"""``hil run`` with a servo link on a free port of a loopback address of its own."""

import re
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from tests.support.processes import Ended, finish, hil, own_host, wait_for_line


@dataclass
class ServoController:
    """A running controller: where applications connect to, and what it said when it ended."""

    address: str
    ended: Ended | None = None


@contextmanager
def servo_controller(*options: object, backend: str = "ideal", port: int = 0) -> Iterator[ServoController]:
    """Run a controller until the block ends; fail if it does not end in order."""
    process = hil("run", "--fri-client", own_host(), "--servo", f"{own_host()}:{port}", "--backend", backend, *options)
    lines = wait_for_line(process, "applications at ")
    found = re.search(r"applications at (\S+),", lines[-1])
    assert found is not None, lines
    controller = ServoController(found[1])
    try:
        yield controller
    finally:
        process.send_signal(signal.SIGINT)
        controller.ended = finish(process)
        assert controller.ended.code == 0, controller.ended.err
