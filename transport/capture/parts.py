"""Names of the files of a ring: ``run.pcapng``, then ``run.00002.pcapng``, ``run.00003.pcapng`` and so on."""

import re
from pathlib import Path
from typing import Final

_PART: Final = re.compile(r"^(?P<stem>.*)\.(?P<number>\d{5,})$")


def part_path(first: Path, number: int) -> Path:
    """Return the path of a part, from 1, of the capture that begins with ``first``."""
    return first if number == 1 else first.with_name(f"{first.stem}.{number:05}{first.suffix}")


def first_and_number(path: Path) -> tuple[Path, int]:
    """Return the path of the first part of the ring that ``path`` may belong to, and which part it is."""
    found = _PART.match(path.stem)
    if found is None:
        return path, 1
    return path.with_name(f"{found['stem']}{path.suffix}"), int(found["number"])


def parts_from(path: Path) -> list[Path]:
    """Return ``path`` and the parts behind it that are there, without a gap."""
    first, number = first_and_number(path)
    parts = [path]
    while (following := part_path(first, number + len(parts))).exists():
        parts.append(following)
    return parts
