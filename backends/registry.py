"""Which robot sides there are: ours and everybody's, by the entry point group ``hil.backends``."""

from collections.abc import Mapping
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec

from hil.values.arm import Backend
from hil.values.backend import BACKEND_GROUP, BackendPlugin, BackendRequest
from hil.values.errors import ConfigurationError, UnknownName


def backend_names() -> tuple[str, ...]:
    """Return the names of all backends that are installed, in alphabetical order."""
    return tuple(sorted(_entries()))


def load_plugin(name: str) -> BackendPlugin:
    """Return what ``name`` offers; raise :class:`UnknownName`, or :class:`ConfigurationError` for a broken one."""
    entries = _entries()
    if name not in entries:
        raise UnknownName("backend", name, sorted(entries))
    entry = entries[name]
    try:
        plugin = entry.load()
    except Exception as error:
        raise ConfigurationError(
            f"the backend {name!r} ({entry.value}) cannot be loaded: {type(error).__name__}: {error}"
        ) from error
    if not isinstance(plugin, BackendPlugin):
        raise ConfigurationError(f"the backend {name!r} ({entry.value}) is no BackendPlugin")
    return plugin


def missing_of(plugin: BackendPlugin) -> str:
    """Return what must be installed before one can be made, empty when nothing is missing."""
    return next((remedy for module, remedy in plugin.needs.items() if find_spec(module) is None), "")


def check_backend(name: str, options: Mapping[str, object] | None = None) -> None:
    """Raise :class:`UnknownName` or :class:`ConfigurationError` if such a robot side cannot be made here."""
    plugin = load_plugin(name)
    if missing := missing_of(plugin):
        raise ConfigurationError(f"the backend {name!r} needs more than is installed: {missing}")
    if options is not None:
        plugin.check_options(options)


def make_backend(name: str, request: BackendRequest) -> Backend:
    """Return a robot side that is not open; raise as :func:`check_backend` does."""
    check_backend(name, request.options)
    return load_plugin(name).make(request)


def origin_of(name: str) -> str:
    """Return the distribution that offers ``name``, with its version."""
    distribution = _entries()[name].dist
    return "unknown" if distribution is None else f"{distribution.name} {distribution.version}"


def _entries() -> dict[str, EntryPoint]:
    found: dict[str, EntryPoint] = {}
    for entry in entry_points(group=BACKEND_GROUP):
        other = found.setdefault(entry.name, entry)
        if other.value != entry.value:
            raise ConfigurationError(
                f"two packages offer a backend {entry.name!r}: {_of(other)} and {_of(entry)}; uninstall one of them"
            )
    return found


def _of(entry: EntryPoint) -> str:
    return f"{'unknown' if entry.dist is None else entry.dist.name} ({entry.value})"
