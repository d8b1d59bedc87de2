"""Where the robots to be watched are: what the user said, or what the pad of the running controller says."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from hil.client.pad import PadClient, only_controller
from hil.values.errors import ConfigurationError
from transport.udp import ANY_HOST

_LOOPBACK = "127.0.0.1"


class Source(NamedTuple):
    """A robot's servo link. ``name`` and ``model`` are empty where only the controller can tell them."""

    address: str
    name: str = ""
    model: str = ""
    key_file: Path | None = None


class Sources(NamedTuple):
    """All that is watched: robots, and the pad of their controller where it is one of this user's, on this machine."""

    robots: tuple[Source, ...]
    pad: Path | None = None
    objects: tuple[dict[str, Any], ...] = ()
    """What stands around the robots, with the keys of an ``[[object]]`` of the station file."""


def from_addresses(addresses: Sequence[str], *, key_file: Path | None = None) -> Sources:
    """Return the robots at those servo addresses; nothing is known of a pad, nor of what stands around them."""
    return Sources(tuple(Source(address, key_file=key_file) for address in addresses))


def from_pad(socket: Path | None = None) -> Sources:
    """Return the robots of the controller with that pad, of the only one that runs when None.

    Raises :class:`ConfigurationError` when none of them serves observers, :class:`EndpointError` without a controller.
    """
    path = only_controller() if socket is None else socket
    with PadClient(path) as pad:
        told = pad.describe()
    robots = [
        Source(
            robot["servo"].replace(ANY_HOST, _LOOPBACK),
            name,
            robot["model"],
            None if robot["servo_key_file"] is None else Path(robot["servo_key_file"]),
        )
        for name, robot in told["robots"].items()
        if robot["servo"] is not None
    ]
    if not robots:
        raise ConfigurationError(
            f"no robot of the controller at {path} has a servo link, through which it is seen; start it without "
            f"--servo off"
        )
    return Sources(tuple(robots), path, tuple(told["objects"]))
