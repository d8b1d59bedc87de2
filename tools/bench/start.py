"""``hil bench start``: from the start of ``hil run`` to its first FRI datagram, several times.

A first run after a reboot also waits for the disk; what is measured here is what follows, with files in the page cache.
"""

import socket
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import Final

from hil.clock import elapsed_ns
from hil.values.errors import EndpointError
from hil.values.fri import Release
from tools.bench.bounds import START_S, Bound, at_most
from tools.bench.processes import start_process

_HOST: Final = "127.0.0.1"
_PATIENCE_S: Final = 20.0


@dataclass(frozen=True, slots=True)
class StartReport:
    """Seconds of each run, and of an interpreter that does nothing."""

    first_packet_s: tuple[float, ...]
    interpreter_s: float

    @property
    def median_s(self) -> float:
        """Return the median of all runs."""
        return median(self.first_packet_s)

    def bounds(self) -> list[Bound]:
        """Return the figures that have a bound."""
        return [at_most("start to first packet, median", round(self.median_s, 3), START_S, "s")]


def bench_start(
    *, robot: str, backend: str, release: Release, repeats: int, progress: Callable[[int], None]
) -> StartReport:
    """Start ``hil run`` so many times; raise :class:`EndpointError` where it sends nothing."""
    taken = []
    for number in range(repeats):
        taken.append(start_to_first_packet(robot=robot, backend=backend, release=release))
        progress(number + 1)
    began_ns = elapsed_ns()
    subprocess.run([sys.executable, "-c", "pass"], check=True)
    return StartReport(tuple(round(seconds, 4) for seconds in taken), round((elapsed_ns() - began_ns) * 1e-9, 4))


def start_to_first_packet(*, robot: str, backend: str, release: Release) -> float:
    """Return the seconds from starting ``hil run`` to its first datagram."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind((_HOST, 0))
        listener.settimeout(_PATIENCE_S)
        before_ns = elapsed_ns()
        controller = start_process(
            "hil.cli.main",
            *("run", "--robot", robot, "--backend", backend, "--fri-version", release),
            *("--fri-client", f"{_HOST}:{listener.getsockname()[1]}", "--servo", f"{_HOST}:0"),
            *("--duration", 0.2, "--progress", 0),
        )
        try:
            listener.recv(2048)
            return (elapsed_ns() - before_ns) / 1e9
        except TimeoutError:
            raise EndpointError(f"hil run sent nothing within {_PATIENCE_S:g} s of its start") from None
        finally:
            controller.terminate()
            controller.communicate()
