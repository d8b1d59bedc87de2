"""A bar for what reads through a capture."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console

if TYPE_CHECKING:
    from hil.replay.replay import ProgressTold


@contextmanager
def file_progress(title: str, *, shown: bool) -> "Iterator[ProgressTold | None]":
    """Yield what is to be told of the progress; None where nothing is ``shown``."""
    if not shown:
        yield None
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[told]}"), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(title, total=None, told="")

        def tell(read_bytes: int, whole_bytes: int, told: str) -> None:
            progress.update(task, completed=read_bytes, total=whole_bytes, told=told)

        yield tell
