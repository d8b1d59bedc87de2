"""What the plugin and a sweep keep on pytest's items."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

import pytest

if TYPE_CHECKING:
    from hil.testkit._sweep import Repetition
    from hil.testkit.controller import VirtualController
    from transport.impairment import Direction

CONTROLLER: "Final[pytest.StashKey[VirtualController]]" = pytest.StashKey()
"""The controller of the run that is on."""
REPETITION: "Final[pytest.StashKey[Repetition]]" = pytest.StashKey()
"""The repetition of a sweep that runs now."""
PACKETS: "Final[pytest.StashKey[Mapping[Direction, int]]]" = pytest.StashKey()
"""How many packets the run that ended last had."""
OWN_ID: Final = "hil_own_id"
"""Attribute of the report of a repetition: the node id it is to have."""
