"""What the KST examples share."""

from typing import Annotated, Final, TypeAlias

import typer

START_RAD: Final = (0.0, 0.3, 0.0, -1.3, 0.0, 1.2, 0.0)
"""Where the examples begin: elbow bent, tool down, far from singularities."""
Controller: TypeAlias = Annotated[
    str, typer.Option("--controller", metavar="HOST[:PORT]", help="Where the KST server is.")
]
DEFAULT_CONTROLLER: Final = "127.0.0.1:30001"


def listed(numbers: tuple[float, ...], digits: int = 4) -> str:
    """Return numbers for a person."""
    return "  ".join(f"{number:{digits + 6}.{digits}f}" for number in numbers)
