"""Writes the recordings of ``tests/data`` anew: ``make goldens``, after a change that is meant to change what we say.

The tests replay them to the byte. Where only the controller's answers changed, ``hil replay FILE --update`` will do.
"""

from pathlib import Path
from typing import Final

from hil.arithmetic import fix_arithmetic

FOLDER: Final = Path(__file__).parents[1] / "tests" / "data"


def main() -> None:
    """Write all of them."""
    fix_arithmetic()
    from tools.goldens import GOLDENS, write_golden

    FOLDER.mkdir(exist_ok=True)
    for golden in GOLDENS:
        file = write_golden(golden, FOLDER)
        print(f"{file}: {file.stat().st_size} bytes")


if __name__ == "__main__":
    main()
