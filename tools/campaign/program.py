"""The programs of a campaign: whether they are there, and whether one was changed since it was played.

A scenario is played again when its program was: the file, the Python files beside it and in packages beside it, or the
whole package of a module, and every file that its arguments name. What is installed elsewhere is not looked at.
"""

import hashlib
import importlib.util
from collections.abc import Iterable, Iterator
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path

from hil.values.errors import ConfigurationError


class Programs:
    """Those of one campaign file, each looked at once."""

    def __init__(self, folder: Path) -> None:
        """Names of files are meant from ``folder`` on, modules from the current one."""
        self._folder = folder
        self._digests: dict[Path, str] = {}
        self._sources: dict[str, tuple[Path, ...]] = {}

    def file(self, path: Path, where: str) -> Path:
        """Return the place of a file; raise :class:`ConfigurationError` where there is none."""
        place = self._folder / path
        if not place.is_file():
            raise ConfigurationError(f"{where}: there is no file {place}")
        return place.resolve()

    def run(self, run: str, where: str) -> str:
        """Return what is to be run for ``run``: the place of a file, or a module; raise :class:`ConfigurationError`."""
        place = str(self.file(Path(run), where)) if run.endswith(".py") else run
        if place not in self._sources:
            self._sources[place] = tuple(_sources(place, where))
        return place

    def digest_of_run(self, place: str, arguments: Iterable[str]) -> str:
        """Return the digest of all that a program from :meth:`run` is made of."""
        named = (Path(argument) for argument in arguments)
        files = sorted({*self._sources[place], *(file.resolve() for file in named if _is_file(file))})
        told = "".join(f"{file.name} {self.digest(file)}\n" for file in files)
        return hashlib.sha256(told.encode()).hexdigest()

    def digest(self, file: Path) -> str:
        """Return the digest of one file."""
        if file not in self._digests:
            with file.open("rb") as stream:
                self._digests[file] = hashlib.file_digest(stream, "sha256").hexdigest()
        return self._digests[file]


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # an argument that cannot be a name
        return False


def _sources(place: str, where: str) -> Iterator[Path]:
    if place.endswith(".py"):
        yield from _beside(Path(place))
        return
    spec = _spec(place)
    if spec is not None and spec.submodule_search_locations is not None:
        spec = _spec(f"{place}.__main__")
    if spec is None or spec.origin is None:
        raise ConfigurationError(
            f"{where}: there is no module {place} that can be run, seen from {Path.cwd()}; a file is named file.py"
        )
    top = _spec(place.partition(".")[0])
    packages = None if top is None else top.submodule_search_locations
    if packages is None:
        yield from _beside(Path(spec.origin))
    else:
        for package in packages:
            yield from Path(package).rglob("*.py")


def _beside(program: Path) -> Iterator[Path]:
    yield program
    yield from program.parent.glob("*.py")
    for package in program.parent.glob("*/__init__.py"):
        yield from package.parent.rglob("*.py")


def _spec(module: str) -> ModuleSpec | None:
    """Return where a module is, without running any part of it."""
    name, *rest = module.split(".")
    try:
        # What the current folder has not may be installed, editable too.
        spec = PathFinder.find_spec(name, [str(Path.cwd())]) or importlib.util.find_spec(name)
    except (ImportError, ValueError):
        return None
    for part in rest:
        if spec is None or spec.submodule_search_locations is None:
            return None
        name = f"{name}.{part}"
        spec = PathFinder.find_spec(name, list(spec.submodule_search_locations))
    return spec
