"""Which robot sides there are: ours and everybody's, by the entry point group ``hil.backends``."""

from collections.abc import Mapping, Sequence
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec

from hil.values.arm import Backend, Capabilities
from hil.values.backend import BACKEND_GROUP, BackendPlugin, BackendRequest
from hil.values.errors import ConfigurationError, UnknownName


def backend_names() -> tuple[str, ...]:
    """Return the names of all backends that are installed, in alphabetical order."""
    return tuple(sorted(_entries()))


def origin_of(name: str) -> str:
    """Return the distributions that offer ``name``, with their versions; raise :class:`UnknownName`."""
    return " and ".join(map(_distribution, _entries_of(name)))


def load_plugin(name: str) -> BackendPlugin:
    """Return what ``name`` offers.

    Raises :class:`UnknownName`, or :class:`ConfigurationError` for a broken one and for a name that two distributions
    offer: which of them would move the arm must not depend on the order of folders.
    """
    found = _entries_of(name)
    if len(found) > 1:
        offers = " and by ".join(f"{_distribution(entry)} ({entry.value})" for entry in found)
        raise ConfigurationError(f"the backend {name!r} is offered by {offers}: uninstall all of them but one")
    entry = found[0]
    of = f"the backend {name!r} ({entry.value} of {_distribution(entry)})"
    try:
        plugin = entry.load()
    except ModuleNotFoundError as error:
        raise ConfigurationError(f"{of} cannot be loaded: there is no module {error.name!r}, install it") from error
    except Exception as error:
        raise ConfigurationError(f"{of} cannot be loaded: {type(error).__name__}: {error}") from error
    if not isinstance(plugin, BackendPlugin):
        raise ConfigurationError(f"{of} is no BackendPlugin of hil.values.backend, but of type {type(plugin).__name__}")
    return plugin


def missing_of(plugin: BackendPlugin) -> str:
    """Return what must be installed before one can be made, empty when nothing is missing."""
    return ", ".join(dict.fromkeys(remedy for module, remedy in plugin.needs.items() if not _is_there(module)))


def capabilities_of(plugin: BackendPlugin) -> Capabilities:
    """Return what one with default options can do; raise :class:`ConfigurationError` where it does not say so."""
    try:
        told = plugin.capabilities()
    except Exception as error:
        raise ConfigurationError(f"does not say what it can do: {type(error).__name__}: {error}") from error
    if not isinstance(told, Capabilities):
        kind = type(told).__name__  # type: ignore[unreachable]
        raise ConfigurationError(f"says what it can do with no Capabilities of hil.values.arm, but type {kind}")
    return told


def check_backend(name: str, options: Mapping[str, object] | None = None) -> None:
    """Raise :class:`UnknownName` or :class:`ConfigurationError` if such a robot side cannot be made here."""
    _checked(name, options)


def make_backend(name: str, request: BackendRequest) -> Backend:
    """Return a robot side that is not open; raise as :func:`check_backend` does."""
    return _checked(name, request.options).make(request)


def _checked(name: str, options: Mapping[str, object] | None) -> BackendPlugin:
    plugin = load_plugin(name)
    if missing := missing_of(plugin):
        raise ConfigurationError(f"the backend {name!r} needs more than is installed: {missing}")
    if options is not None:
        plugin.check_options(options)
    return plugin


def _is_there(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:
        # Of a module in a package that is not there either.
        return False


def _distribution(entry: EntryPoint) -> str:
    return "an unknown distribution" if entry.dist is None else f"{entry.dist.name} {entry.dist.version}"


def _entries_of(name: str) -> Sequence[EntryPoint]:
    entries = _entries()
    if name not in entries:
        raise UnknownName("backend", name, sorted(entries))
    return entries[name]


def _entries() -> dict[str, list[EntryPoint]]:
    entries: dict[str, list[EntryPoint]] = {}
    for entry in entry_points(group=BACKEND_GROUP):
        entries.setdefault(entry.name, []).append(entry)
    return entries
