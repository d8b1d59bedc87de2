"""The test kit's controller without pytest's fixture, and its plugin for tests that run pytest."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import entry_points
from typing import Any

from hil.testkit import VirtualController
from hil.testkit._configuration import configuration

LOADED_BY_ITSELF = any(point.value == "hil.testkit.plugin" for point in entry_points(group="pytest11"))
"""Whether the package that is installed already has the plugin; an older one may be, with our sources before it."""
PLUGIN = () if LOADED_BY_ITSELF else ("-p", "hil.testkit.plugin")


@contextmanager
def controller(**keys: Any) -> Iterator[VirtualController]:
    """A controller in virtual time, with the keys of the mark ``hil``."""
    chosen = configuration([((), keys)], folders=[])
    made = VirtualController(chosen.robot, limit_s=chosen.limit_s)
    with made.active():
        yield made
