"""``hil can-drives``: seven simulated CiA 402 drives as a process of their own, on a real or a simulated CAN bus."""

import signal
import threading
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.live import Live
from rich.table import Table

from hil.clock import elapsed_ns
from hil.values.errors import ConfigurationError, UnknownName
from hil.values.robot import JOINT_COUNT, JOINT_NAMES

if TYPE_CHECKING:
    from backends.can402.simulated import SimulatedDrives
    from backends.can402.wire import Wire

_LOOK_S = 0.02
_SHOW_NS = 500_000_000


def can_drives(  # noqa: PLR0917  # typer makes the options of the parameters
    interface: Annotated[str, typer.Option(help="python-can's name of the interface, such as socketcan or slcan.")],
    channel: Annotated[str, typer.Option(help="python-can's name of the channel, such as vcan0 or /dev/ttyACM0.")],
    bitrate: Annotated[int, typer.Option(min=10_000, max=1_000_000, help="bit/s.")] = 1_000_000,
    nodes: Annotated[str, typer.Option(metavar="1,2,3,4,5,6,7", help="Node numbers of A1 to A7.")] = "1,2,3,4,5,6,7",
    robot: Annotated[str, typer.Option(help="Robot model, for where the axes stand at first.")] = "lbr-iiwa-14-r820",
    cycle_ms: Annotated[int, typer.Option("--cycle", min=1, max=5, help="Time between two SYNCs, ms.")] = 4,
    fault: Annotated[
        list[str] | None,
        typer.Option(metavar="NODE:FAULT", help="lost, boot, identity, no-402, ..., or an error code, as 4:0x2310."),
    ] = None,
    fault_after: Annotated[float, typer.Option(metavar="S", min=0.0, help="When the faults begin.")] = 0.0,
    duration: Annotated[float | None, typer.Option(metavar="S", min=0.0, help="End after so many seconds.")] = None,
) -> None:
    """Run seven simulated drives on a CAN bus until Ctrl-C."""
    from backends.can402.options import parse_options
    from backends.can402.wire import open_wire
    from backends.registry import check_backend

    check_backend("can402")
    if interface == "virtual":
        raise ConfigurationError(
            "python-can's virtual bus lives inside one process: hil run --backend can402 -o simulated=true has its own "
            "drives; give a socketcan or an slcan interface"
        )
    options = parse_options({"interface": interface, "channel": channel, "bitrate": bitrate, "nodes": _numbers(nodes)})
    faults = [_fault(text, options.nodes) for text in fault or []]
    drives = _drives(options.nodes, robot)
    wire = open_wire(options, never_blocks=False)
    try:
        _serve(drives, wire, faults, cycle_ms=cycle_ms, fault_after_s=fault_after, duration_s=duration)
    finally:
        wire.close()


def _drives(nodes: tuple[int, ...], robot: str) -> "SimulatedDrives":
    from backends.can402.options import AxisOptions
    from backends.can402.scaling import AxisScale
    from backends.can402.simulated import SimulatedDrives
    from backends.robots import load_description

    scale = AxisScale(AxisOptions())
    return SimulatedDrives(nodes, [scale.counts(start) for start in load_description(robot).initial_position_rad])


def _serve(
    drives: "SimulatedDrives",
    wire: "Wire",
    faults: list[tuple[int, str]],
    *,
    cycle_ms: int,
    fault_after_s: float,
    duration_s: float | None,
) -> None:
    stopping = threading.Event()
    before = {number: signal.signal(number, lambda *_: stopping.set()) for number in (signal.SIGINT, signal.SIGTERM)}
    console = Console(stderr=True)
    began_ns = beat_ns = shown_ns = elapsed_ns()
    console.print("seven drives are on the bus", highlight=False)
    try:
        with Live(_table(drives), console=console, auto_refresh=False, transient=True) as live:
            while not stopping.is_set():
                drives.pump(wire, period_ns=cycle_ms * 1_000_000, wait_s=_LOOK_S)
                now_ns = elapsed_ns()
                for beat in drives.passed(now_ns - beat_ns):
                    wire.send(beat)
                beat_ns = now_ns
                if faults and now_ns - began_ns >= fault_after_s * 1e9:
                    for node, what in faults:
                        _inject(drives, wire, node, what)
                    faults = []
                if now_ns - shown_ns >= _SHOW_NS:
                    shown_ns = now_ns
                    live.update(_table(drives), refresh=console.is_terminal)
                if duration_s is not None and now_ns - began_ns >= duration_s * 1e9:
                    break
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    Console(highlight=False).print(_table(drives))


def _inject(drives: "SimulatedDrives", wire: "Wire", node: int, what: str) -> None:
    from backends.can402.simulated import DriveFault

    drive = next(one for one in drives.drives if one.node == node)
    if what.startswith("0x"):
        frames = drive.fail(int(what, 16))
    elif what == DriveFault.BOOT:
        frames = drive.boot()
    else:
        drive.faults.add(DriveFault(what))
        frames = drive.boot() if what in {DriveFault.IDENTITY, DriveFault.NO_402} else []
    for frame in frames:
        wire.send(frame)


def _fault(text: str, nodes: tuple[int, ...]) -> tuple[int, str]:
    from backends.can402.simulated import DriveFault

    number, colon, what = text.partition(":")
    if not colon or not number.isdecimal() or int(number) not in nodes:
        raise ConfigurationError(f"--fault {text!r}: NODE:FAULT is needed, with one of the nodes {_told(nodes)}")
    if what.startswith("0x"):
        try:
            code = int(what, 16)
        except ValueError:
            code = -1
        if not 0 < code <= 0xFFFF:
            raise ConfigurationError(f"--fault {text!r}: {what} is no error code from 0x0001 to 0xFFFF")
    elif what not in [*DriveFault]:
        raise UnknownName("fault", what, [*DriveFault, "0x2310"])
    return int(number), what


def _numbers(text: str) -> list[int]:
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise ConfigurationError(f"--nodes {text!r}: {JOINT_COUNT} numbers are needed, such as 1,2,3,4,5,6,7") from None


def _told(nodes: tuple[int, ...]) -> str:
    return ", ".join(map(str, nodes))


def _table(drives: "SimulatedDrives") -> Table:
    table = Table("axis", "node", "state", "counts", "error", title="simulated drives")
    for axis, drive in zip(JOINT_NAMES, drives.drives, strict=True):
        error = f"0x{drive.error_code:04X}" if drive.error_code else ""
        table.add_row(axis, str(drive.node), drive.state.value, str(drive.counts), error)
    return table
