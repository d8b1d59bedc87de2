"""How a robot side is offered: what it is told, what it can do before it is made, and what it needs installed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

from hil.values.arm import Backend, Capabilities
from hil.values.errors import ConfigurationError
from hil.values.load import NO_LOAD, Load
from hil.values.pose import NOWHERE, Pose
from hil.values.robot import RobotDescription
from hil.values.surroundings import Surroundings

BACKEND_GROUP: Final = "hil.backends"
"""Entry point group: each entry's name is what a station file calls the backend, its value a :class:`BackendPlugin`."""


@dataclass(frozen=True, slots=True)
class BackendRequest:
    """What a robot side is told when it is made; ``options`` are ``[robot.options]`` of the station file, unchecked."""

    robot: str
    """Name of the robot in the station."""
    description: RobotDescription
    cycle_ns: int
    options: Mapping[str, object] = field(default_factory=dict)
    seed: int = 0
    load: Load = NO_LOAD
    """What truly hangs on the flange of a simulated arm."""
    torque_noise: bool = True
    base_in_world: Pose = NOWHERE
    surroundings: Surroundings = field(default_factory=Surroundings)
    """What else is in the station; the same object for all its robots."""


@dataclass(frozen=True, slots=True)
class BackendPlugin:
    """One kind of robot side. To load it must be cheap: what it needs is imported when one is made."""

    summary: str
    """One line, for ``hil backends``."""
    make: Callable[[BackendRequest], Backend]
    """Return one that is not open; raise :class:`ConfigurationError` for options it does not know."""
    capabilities: Callable[[], Capabilities]
    """What one with default options can do."""
    check_options: Callable[[Mapping[str, object]], None]
    """Raise :class:`ConfigurationError` in one sentence for options that cannot be."""
    options_help: Mapping[str, str] = field(default_factory=dict)
    """Name of each option, and what it is."""
    needs: Mapping[str, str] = field(default_factory=dict)
    """Module that must be there, and what to install for it."""
    replays: bool = True
    """Whether a recording of it can be played again: all its inputs are the seed and the datagrams of the links."""


def no_options(options: Mapping[str, object]) -> None:
    """Raise :class:`ConfigurationError` if there are any."""
    if options:
        raise ConfigurationError(f"this backend has no options, {next(iter(options))!r} is given")
