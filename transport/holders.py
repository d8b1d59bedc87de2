"""Which process holds a port: for the sentence that says it is taken. Linux, and processes of this user only."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from hil.values.link import Address

_ANY: Final = "00000000"
_LISTENS: Final = "0A"
_WORDS_MOST: Final = 60
_SOCKET: Final = re.compile(r"socket:\[(\d+)\]")


def held_by(kind: str, address: Address) -> str:
    """Return ``"; process 42 (hil run) has it"`` for a ``"udp"`` or ``"tcp"`` address, or an empty text."""
    inodes = set(_inodes(kind, address))
    process = _process_with(inodes) if inodes else None
    return "" if process is None else f"; {told_process(process)} has it"


def told_process(process: int) -> str:
    """Return a process in words: its number, and what it was started with if that can be known."""
    try:
        words = (Path("/proc") / str(process) / "cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return f"process {process}"
    # The interpreter's path and its options say nothing to a user.
    started = " ".join(word for word in words if word)
    module = re.search(r"(?:-m hil\.cli\.main|bin/hil)(?= |$)(.*)", started)
    text = f"hil{module[1]}" if module is not None else started
    printable = "".join(letter if letter.isprintable() else "?" for letter in text)
    shown = printable if len(printable) <= _WORDS_MOST else printable[:_WORDS_MOST] + "..."
    return f"process {process} ({shown})" if shown else f"process {process}"


def _inodes(kind: str, address: Address) -> Iterator[str]:
    """Yield the sockets that stand in the way of binding ``address``."""
    try:
        host = "".join(f"{int(part):02X}" for part in reversed(address.host.split(".")))
        lines = Path(f"/proc/net/{kind}").read_text(encoding="ascii").splitlines()[1:]
    except (OSError, ValueError):
        return
    for line in lines:
        words = line.split()
        if len(words) < 10:
            continue
        there, _, port = words[1].partition(":")
        same = there == host or _ANY in {there, host}
        if same and int(port, 16) == address.port and (kind == "udp" or words[3] == _LISTENS):
            yield words[9]


def _process_with(inodes: set[str]) -> int | None:
    """Return a process that has one of these sockets open."""
    for folder in Path("/proc").iterdir():
        if not folder.name.isdecimal():
            continue
        try:
            for link in (folder / "fd").iterdir():
                found = _SOCKET.fullmatch(str(link.readlink()))
                if found is not None and found[1] in inodes:
                    return int(folder.name)
        except OSError:
            continue
    return None
