"""Waiting for something that says nothing when it comes."""

import threading
from collections.abc import Callable
from typing import Final

from hil.clock import elapsed_ns
from hil.values.errors import EndpointError

_LOOK_S: Final = 0.05
_NS: Final = 1e9


def wait_for(condition: Callable[[], object], at_most_s: float, what: str) -> None:
    """Look again and again until it is there; raise :class:`EndpointError` that names ``what`` was waited for."""
    never, begun_ns = threading.Event(), elapsed_ns()
    while not condition():
        if (elapsed_ns() - begun_ns) / _NS > at_most_s:
            raise EndpointError(f"{what} was not ready within {at_most_s:g} s")
        never.wait(_LOOK_S)
