"""Options that several benchmarks have."""

from typing import TYPE_CHECKING, Annotated

import typer

from hil.values.errors import UnknownName
from hil.values.fri import Release

if TYPE_CHECKING:
    from tools.bench.clients import BenchMotion

Robot = Annotated[str, typer.Option(help="Robot model.")]
Backend = Annotated[str, typer.Option(help="Robot side.")]
FriVersion = Annotated[Release, typer.Option(help="FRI release of the client.")]
Motion = Annotated[
    str, typer.Option(help="What moves the arm: fri-overlay, smart-servo or direct-servo, retargeted each cycle.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]


def motion_named(name: str) -> "BenchMotion":
    """Return the motion of ``--motion``; raise :class:`UnknownName`."""
    from tools.bench.clients import BenchMotion

    try:
        return BenchMotion(name)
    except ValueError:
        raise UnknownName("motion", name, [known.value for known in BenchMotion]) from None
