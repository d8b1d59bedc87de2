"""Something to draw into without a screen: EGL, else OSMesa, which needs no graphics card either."""

import ctypes
import importlib
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

from hil.values.errors import ConfigurationError

_LIBRARIES: Final = {"egl": ("libEGL.so.1",), "osmesa": ("libOSMesa.so.8", "libOSMesa.so.6")}
_ON_SCREEN: Final = (
    "",
    "glfw",
    "glx",
    "enable",
    "enabled",
    "on",
    "true",
    "1",
    "disable",
    "disabled",
    "off",
    "false",
    "0",
)
"""What else MuJoCo takes; it means nothing to a picture that is drawn off screen."""
_INSTALL: Final = "install libegl1, libgl1 and libgl1-mesa-dri, or libosmesa6 (names of Debian)"


@contextmanager
def drawing_surface(width: int, height: int, environment: Mapping[str, str] = os.environ) -> Iterator[None]:
    """Make a surface current for the block, of the kind that MUJOCO_GL names, or else of the first one there is.

    Raises :class:`ConfigurationError` in one sentence where there is none.
    """
    kind = choose(environment)
    try:
        context: Any = importlib.import_module(f"mujoco.{kind}").GLContext(width, height)
    except Exception as error:
        # PyOpenGL fails with whatever its loader stumbles over: an attribute, an import, an error of its own.
        raise ConfigurationError(
            f"no picture without a screen: {kind} fails ({_first_line(error)}); {_other(kind)}"
        ) from error
    try:
        context.make_current()
        yield
    finally:
        context.free()


def choose(environment: Mapping[str, str]) -> str:
    """Return ``egl`` or ``osmesa``; raise :class:`ConfigurationError` where neither is there.

    To be asked before MuJoCo is imported, which fails where MUJOCO_GL names what is not there.
    """
    wanted = environment.get("MUJOCO_GL", "").strip().lower()
    if wanted not in {*_LIBRARIES, *_ON_SCREEN}:
        raise ConfigurationError(f"MUJOCO_GL is {wanted!r}; off screen it is {' or '.join(_LIBRARIES)}, or not set")
    for kind in (wanted,) if wanted in _LIBRARIES else _LIBRARIES:
        if any(map(_is_there, _LIBRARIES[kind])):
            return kind
    missing = wanted if wanted in _LIBRARIES else "EGL and no OSMesa"
    raise ConfigurationError(f"no picture without a screen: there is no {missing} here; {_INSTALL}")


def _is_there(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def _other(kind: str) -> str:
    other = next(one for one in _LIBRARIES if one != kind)
    return f"set MUJOCO_GL={other}" if any(map(_is_there, _LIBRARIES[other])) else _INSTALL


def _first_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return lines[0].rstrip(". ") if lines else type(error).__name__
