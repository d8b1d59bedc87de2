"""Processes of ours that a benchmark starts."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from hil.values.errors import EndpointError


def start_process(module: str, *arguments: object) -> "subprocess.Popen[bytes]":
    """Start a module of ours, silent."""
    return subprocess.Popen(
        [sys.executable, "-m", module, *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )


def wait_for_end(process: "subprocess.Popen[bytes]", at_most_s: float, progress: Callable[[float], None]) -> None:
    """Wait for a process, and tell ``progress`` how long that took so far; raise :class:`EndpointError`."""
    waited_s = 0.0
    while waited_s < at_most_s:
        try:
            process.wait(0.5)
        except subprocess.TimeoutExpired:
            waited_s += 0.5
            progress(waited_s)
        else:
            return
    process.kill()
    process.wait()
    raise EndpointError(f"{process.args!r} did not end within {at_most_s:g} s")


@contextmanager
def burning_core() -> Iterator[None]:
    """Keep the last core of this machine busy until the block ends."""
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else [0]
    process = start_process("tools.bench.burn", os.getpid(), cores[-1])
    try:
        yield
    finally:
        process.kill()
        process.wait()
