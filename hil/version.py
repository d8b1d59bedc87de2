"""The version, from the installed distribution."""

from importlib.metadata import PackageNotFoundError, version


def _read() -> str:
    try:
        return version("fri-hil")
    except PackageNotFoundError:
        return "not installed"


VERSION = _read()
SOFTWARE = f"fri-hil {VERSION}"
"""As results, captures and the servo link tell it."""
