"""What is installed in the way of robot sides, looked at one by one: a broken one says what is wrong with it."""

from dataclasses import dataclass

from backends.registry import backend_names, capabilities_of, load_plugin, missing_of, origin_of
from hil.values.arm import Capabilities
from hil.values.backend import BackendPlugin
from hil.values.errors import HilError


@dataclass(frozen=True, slots=True)
class InstalledBackend:
    """One backend by its name; without a plugin it cannot be loaded, without capabilities it cannot be used."""

    name: str
    origin: str
    """Distribution and version."""
    plugin: BackendPlugin | None
    capabilities: Capabilities | None
    """Of one with default options."""
    problem: str
    """Why it cannot be used as it is; empty when it can."""


def installed_backends() -> tuple[InstalledBackend, ...]:
    """Return all backends in alphabetical order."""
    return tuple(map(installed_backend, backend_names()))


def installed_backend(name: str) -> InstalledBackend:
    """Return one backend; raise :class:`UnknownName`, and nothing for one that is broken."""
    origin = origin_of(name)
    try:
        plugin = load_plugin(name)
    except HilError as error:
        return InstalledBackend(name, origin, None, None, str(error))
    if missing := missing_of(plugin):
        return InstalledBackend(name, origin, plugin, None, f"needs more than is installed: {missing}")
    try:
        return InstalledBackend(name, origin, plugin, capabilities_of(plugin), "")
    except HilError as error:
        return InstalledBackend(name, origin, plugin, None, str(error))
