"""Writes the recordings of ``tests/data`` anew: ``make goldens``, after a change that is meant to change what we say.

Where emulator and the recordings of ``../shared/captures`` part is written beside them.

The tests replay them to the byte. Where only the controller's answers changed, ``hil replay FILE --update`` will do.
"""

import json
from pathlib import Path
from typing import Final

from hil.arithmetic import fix_arithmetic

FOLDER: Final = Path(__file__).parents[1] / "tests" / "data"
CAPTURES: Final = Path(__file__).parents[1].parent / "shared" / "captures"


def main() -> None:
    """Write all of them."""
    fix_arithmetic()
    from hil.replay.replay import replay_file
    from tools.goldens import GOLDENS, parting, write_golden

    FOLDER.mkdir(exist_ok=True)
    for golden in GOLDENS:
        file = write_golden(golden, FOLDER)
        print(f"{file}: {file.stat().st_size} bytes")
    if CAPTURES.is_dir():
        told = {file.stem: parting(replay_file(file)) for file in sorted(CAPTURES.glob("*.pcapng"))}
        (FOLDER / "elsewhere.json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
