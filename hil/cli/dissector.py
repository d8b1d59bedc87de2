"""``hil dissector``: where Wireshark's dissector is, how to use it, and putting it where Wireshark finds it itself."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import typer

from hil.values.errors import ConfigurationError

_FOLDERS_TIMEOUT_S = 20.0
_LUA_FOLDERS = ("Personal Lua Plugins:", "Personal Plugins:")
"""How ``tshark -G folders`` calls the folder, the newer name first; the older one may end with a version."""


def dissector(
    install: Annotated[
        bool, typer.Option("--install", help="Copy it into your Wireshark's folder, so that it is always loaded.")
    ] = False,
) -> None:
    """Show where Wireshark's dissector of FRI and the servo link is, and how to use it."""
    from tools.wireshark import DISSECTOR

    if install:
        typer.echo(f"wrote {_install(DISSECTOR)}; Wireshark and tshark load it when they start")
        return
    typer.echo(str(DISSECTOR))
    typer.echo(f"use it once:    tshark -X lua_script:{DISSECTOR} -r FILE")
    typer.echo("or always:      hil dissector --install")
    typer.echo("filters:        fri.monitor.measured_position, servo.state.snapshot.cycle; all: tshark -G fields")


def _install(source: Path) -> Path:
    """Copy ``source`` into the personal folder and return the copy; raise :class:`ConfigurationError`."""
    from tools.wireshark import FIRST_LINE

    target = _folder() / source.name
    try:
        if target.exists() and not target.read_bytes().startswith(FIRST_LINE.encode()):
            raise ConfigurationError(f"{target} is there already and is not ours; move it away first")
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, target)
    except OSError as error:
        why = error.strerror or error
        raise ConfigurationError(
            f"cannot write {target}: {why}; without it: tshark -X lua_script:{source} -r FILE"
        ) from error
    return target


def _folder() -> Path:
    """Return the folder that Wireshark says it loads its user's Lua from, else the one it does by default."""
    tshark = shutil.which("tshark")
    if tshark is not None:
        try:
            told = subprocess.run(
                [tshark, "-G", "folders"], capture_output=True, text=True, timeout=_FOLDERS_TIMEOUT_S, check=True
            ).stdout
        except (OSError, subprocess.SubprocessError):
            told = ""
        for name in _LUA_FOLDERS:
            for line in told.splitlines():
                folder = line.removeprefix(name).strip()
                if line.startswith(name) and folder:
                    return Path(folder)
    if sys.platform == "win32" and "APPDATA" in os.environ:
        return Path(os.environ["APPDATA"]) / "Wireshark" / "plugins"
    return Path.home() / ".local" / "lib" / "wireshark" / "plugins"
