"""The module ``time`` as an application meets it in virtual time: sleeping lets time pass, and clocks show it.

What the interpreter's and the test runner's own modules read stays real, and so does what other threads read. A name
that was bound before (``from time import sleep``) is not replaced.
"""

import inspect
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

from hil.testkit._world import UNIX_EPOCH_NS, World

READING_NS: Final = 1_000
"""What reading a clock costs, so that a loop that waits by reading one comes to an end."""
_REAL_FOR: Final = {"_pytest", "execnet", "hypothesis", "pluggy", "pytest_asyncio", "pytest_timeout", "xdist"} | {
    "asyncio", "concurrent", "faulthandler", "multiprocessing", "queue", "selectors", "socket", "threading",
}  # fmt: skip
"""Top-level packages that measure the machine, not the application."""


@contextmanager
def virtual_time_module(world: World) -> Iterator[None]:
    """Let the functions of :mod:`time` tell the time of ``world`` until the block ends."""

    def sleep(seconds: float, /) -> None:
        if seconds < 0:
            raise ValueError("sleep length must be non-negative")
        world.pass_ns(round(seconds * 1e9))

    def read_ns() -> int:
        if world.may_wait():
            world.pass_ns(READING_NS)
        return world.now_ns

    virtual: dict[str, Callable[..., Any]] = {
        "sleep": sleep,
        "monotonic": lambda: read_ns() * 1e-9,
        "monotonic_ns": read_ns,
        "perf_counter": lambda: read_ns() * 1e-9,
        "perf_counter_ns": read_ns,
        "time": lambda: (UNIX_EPOCH_NS + read_ns()) * 1e-9,
        "time_ns": lambda: UNIX_EPOCH_NS + read_ns(),
    }
    # Not imported, as everywhere but in hil.clock: what is done to it here concerns the module that others imported.
    time = sys.modules["time"]
    real = {name: getattr(time, name) for name in virtual}
    for name, function in virtual.items():
        setattr(time, name, _for_applications(world, function, real[name]))
    try:
        yield
    finally:
        for name, function in real.items():
            setattr(time, name, function)


def _for_applications(world: World, virtual: Callable[..., Any], real: Callable[..., Any]) -> Callable[..., Any]:
    def chosen(*arguments: Any) -> Any:
        frame = inspect.currentframe()
        caller = None if frame is None else frame.f_back
        module = "" if caller is None else str(caller.f_globals.get("__name__", ""))
        if module.partition(".")[0] in _REAL_FOR or not world.in_its_thread():
            return real(*arguments)
        return virtual(*arguments)

    return chosen
