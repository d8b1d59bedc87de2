"""Captures of a run, played again: through a fresh controller, or as one side of a live conversation.

::

    from hil.replay import replay_file

    result = replay_file("run.pcapng")
    assert result.equal, result.verdict
"""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.replay.result import ReplayResult


def replay_file(file: str | Path, *, key_file: str | Path | None = None) -> "ReplayResult":
    """Replay a capture; a recording of ours to the byte, another one beside an emulator.

    ``key_file`` is the servo link's key, where it moved. Raises ``CaptureError`` where nothing of the file
    can be read, and ``ConfigurationError`` where the controller it tells of cannot be made here.
    """
    from hil.replay.replay import replay_file as replay

    return replay(Path(file), key_file=None if key_file is None else Path(key_file))
