"""Processor time of processes, and of all that they started."""

import os
from collections import defaultdict
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

_PROCESSES: Final = Path("/proc")
_KIND: Final = b"--type="


class _Process(NamedTuple):
    parent: int
    used_s: float
    kind: str


def processor_s(process_id: int) -> dict[str, float]:
    """Return the seconds that a process and those below it have used, by what Chromium calls their ``--type``.

    The kind of all others is empty. A process that ended is counted with the one that waited for it. Nothing is known,
    and nothing returned, where there is no ``/proc``.
    """
    processes = _all_processes()
    used: dict[str, float] = defaultdict(float)
    found = [process_id] if process_id in processes else []
    while found:
        one = found.pop()
        used[processes[one].kind] += processes[one].used_s
        found.extend(child for child, process in processes.items() if process.parent == one)
    return dict(used)


def children(process_id: int, *, saying: str) -> list[int]:
    """Return the processes that one started and that have ``saying`` among their arguments."""
    found = []
    for child, process in _all_processes().items():
        if process.parent == process_id and saying.encode() in _arguments(child):
            found.append(child)
    return found


def _all_processes() -> dict[int, _Process]:
    tick_s = 1.0 / os.sysconf("SC_CLK_TCK")
    found = {}
    for folder in _PROCESSES.glob("[0-9]*"):
        # One that ends meanwhile has no files any more.
        with suppress(OSError):
            # The name of the program stands in parentheses, and may have any in it.
            fields = (folder / "stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
            kinds = [one for one in _arguments(int(folder.name)) if one.startswith(_KIND)]
            kind = kinds[0].removeprefix(_KIND).decode(errors="replace") if kinds else ""
            found[int(folder.name)] = _Process(int(fields[1]), tick_s * sum(map(int, fields[11:15])), kind)
    return found


def _arguments(process_id: int) -> list[bytes]:
    with suppress(OSError):
        return (_PROCESSES / str(process_id) / "cmdline").read_bytes().replace(b" ", b"\0").split(b"\0")
    return []
