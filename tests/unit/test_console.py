"""Saying never blocks, and what is lost is counted."""

import io
import threading

from hil.runtime.console import QUEUED_LINES, Console


class Stuck(io.StringIO):
    """A reader that takes nothing until released."""

    def __init__(self) -> None:
        super().__init__()
        self.released = threading.Event()

    def write(self, text: str) -> int:
        self.released.wait(10)
        return super().write(text)


def test_a_stuck_reader_holds_up_nobody() -> None:
    stream = Stuck()
    console = Console(stream)
    for number in range(QUEUED_LINES + 500):
        console.say(f"line {number}")
    stream.released.set()
    console.close()
    lines = stream.getvalue().splitlines()
    assert lines[0] == "line 0"
    assert len(lines) < QUEUED_LINES + 500
    assert "lines were not written: nobody read fast enough" in lines[-1]


def test_a_closed_stream_is_survived() -> None:
    stream = io.StringIO()
    console = Console(stream)
    stream.close()
    console.say("anybody?")
    console.close()
    assert not console._thread.is_alive()
