"""What this process holds of the system, to be compared before and after: descriptors, threads, children, tasks."""

import asyncio
import gc
import os
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple


class Held(NamedTuple):
    """Names, so that a difference says what was left."""

    descriptors: Counter[str]
    threads: Counter[str]
    children: Counter[str]
    tasks: Counter[str]

    def left_since(self, before: "Held") -> dict[str, list[str]]:
        """Return what is held now and was not ``before``."""
        kinds = zip(self._fields, self, before, strict=True)
        return {kind: sorted((now - then).elements()) for kind, now, then in kinds if now - then}


def held() -> Held:
    """Look, after the garbage was collected: what only waited for that raises a ResourceWarning, an error here."""
    gc.unfreeze()  # hil run freezes what there is when it starts
    gc.collect()
    try:
        tasks = Counter(task.get_name() for task in asyncio.all_tasks())
    except RuntimeError:
        tasks = Counter()
    return Held(_descriptors(), Counter(thread.name for thread in threading.enumerate()), _children(), tasks)


@contextmanager
def nothing_left() -> Iterator[None]:
    """Fail where what ran inside left something."""
    before = held()
    yield
    if left := held().left_since(before):
        raise AssertionError(f"left behind: {left}")


def _descriptors() -> Counter[str]:
    found: Counter[str] = Counter()
    for link in Path("/proc/self/fd").iterdir():
        try:
            target = str(link.readlink())
        except FileNotFoundError:
            continue
        # The numbers of sockets and pipes are new each time; the count of each kind is what must not grow.
        found[target.partition(":[")[0]] += 1
    return found


def _children() -> Counter[str]:
    found: Counter[str] = Counter()
    for folder in Path("/proc").iterdir():
        if not folder.name.isdecimal():
            continue
        try:
            name, _, rest = (folder / "stat").read_text().rpartition(")")
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(rest.split()[1]) == os.getpid():
            found[name.partition("(")[2]] += 1
    return found
