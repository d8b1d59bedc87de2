"""What every long-running command does alike: an orderly end, a line now and then, a result that can be written."""

import asyncio
import json
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from hil.values.errors import ConfigurationError
from transport.claims import claim_file


@contextmanager
def stop_on_signals(stop: Callable[[], None]) -> Iterator[None]:
    """Call ``stop`` at SIGINT and SIGTERM, however often they come."""
    loop = asyncio.get_running_loop()
    numbers = (signal.SIGINT, signal.SIGTERM)
    for number in numbers:
        loop.add_signal_handler(number, stop)
    try:
        yield
    finally:
        for number in numbers:
            loop.remove_signal_handler(number)


@contextmanager
def repeated(period_s: float, action: Callable[[], None]) -> Iterator[None]:
    """Call ``action`` about every ``period_s`` seconds; never for 0."""
    loop = asyncio.get_running_loop()
    handles: list[asyncio.TimerHandle] = []

    def again() -> None:
        handles[:] = [loop.call_later(period_s, again)]
        action()

    if period_s > 0:
        handles.append(loop.call_later(period_s, again))
    try:
        yield
    finally:
        for handle in handles:
            handle.cancel()


def check_result_file(file: Path | None) -> None:
    """Raise :class:`ConfigurationError` now where ``file`` could not be written at the end."""
    if file is None:
        return
    if not file.parent.is_dir():
        raise ConfigurationError(f"cannot write {file}: there is no folder {file.parent}")
    if file.is_dir():
        raise ConfigurationError(f"cannot write {file}: that is a folder")
    if not os.access(file if file.exists() else file.parent, os.W_OK):
        raise ConfigurationError(f"cannot write {file}: permission denied")


@contextmanager
def claimed_result_file(file: Path | None) -> Iterator[None]:
    """Let no other process have ``file`` for its results meanwhile; raise :class:`ConfigurationError` where one has.

    What is neither a file nor to become one, a device or a pipe, is not claimed. A file that was made for the claim and
    got no result is removed.
    """
    if file is None or (file.exists() and not file.is_file()):
        yield
        return
    is_new = not file.exists()
    try:
        descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise ConfigurationError(f"cannot write {file}: {error.strerror or error}") from error
    try:
        if holder := claim_file(descriptor):
            is_new = False
            raise ConfigurationError(f"cannot write {file}: {holder} writes its results there; choose another file")
        yield
    finally:
        if is_new and not os.fstat(descriptor).st_size:
            file.unlink(missing_ok=True)
        os.close(descriptor)


def write_result_file(file: Path | None, result: object) -> None:
    """Write ``result`` to ``file`` as JSON, where there is a file."""
    if file is not None:
        file.write_text(result_text(result), encoding="utf-8")


def result_text(result: object) -> str:
    """Return ``result`` as JSON."""
    return json.dumps(result, indent=2) + "\n"
