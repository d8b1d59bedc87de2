"""The progress bar of the commands that read a capture."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

if TYPE_CHECKING:
    from hil.replay.replay import ProgressTold


@contextmanager
def reading_bar(verb: str, file: Path, *, shown: bool) -> "Iterator[ProgressTold | None]":
    """Show how far a capture is read: bytes of bytes, and in words how fast; nothing unless ``shown``."""
    if not shown:
        yield None
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[told]}"), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(f"{verb} {file.name}", total=None, told="")

        def tell(read_bytes: int, whole_bytes: int, told: str) -> None:
            progress.update(task, completed=read_bytes, total=whole_bytes, told=told)

        yield tell
