"""``hil replay``: a capture through the controller again, on the virtual clock."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from hil.cli.json_output import JsonOutput
from hil.cli.plain import plain
from hil.cli.reading_bar import reading_bar
from hil.values.errors import UsageError
from hil.values.fri import Release, SessionState

if TYPE_CHECKING:
    from hil.replay.result import ReplayResult

_MAX = "max"
_DIFFERENT = 1
_UNREADABLE = 2
_FIELDS_SHOWN = 25
_SESSION_STATE = "session state"
_STATE_NAMES: dict[object, str] = {int(state): state.name for state in SessionState}


def replay(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Capture: pcapng or pcap, of hil run or from elsewhere.")
    ],
    speed: Annotated[
        str, typer.Option(metavar="N|max", help="Times real time, or as fast as the machine can (the default).")
    ] = _MAX,
    json_file: Annotated[
        str | None, typer.Option("--json", metavar="FILE|-", help="Write what was found; -: to the output, alone.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE.png", help="Draw recorded and emulated positions."),
    ] = None,
    update: Annotated[
        bool, typer.Option("--update", help="Make what the emulator says now the recording; of hil run only.")
    ] = False,
    servo_key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Key of the servo link, where it is not where it was.")
    ] = None,
    beside: Annotated[
        bool, typer.Option("--beside", help="Compare a recording of ours as if it came from elsewhere.")
    ] = False,
    fri_version: Annotated[
        Release | None, typer.Option(help="Elsewhere: release of the client's FRI library, where it cannot be told.")
    ] = None,
    robot: Annotated[str | None, typer.Option(help="Elsewhere: robot model; lbr-iiwa-14-r820 is the default.")] = None,
    backend: Annotated[str | None, typer.Option(help="Elsewhere: robot side; mujoco is the default.")] = None,
) -> None:
    """Replay a capture: every byte the controller sent is compared. Exit code 0: the same; 1: not; 2: not readable.

    A capture from elsewhere (tcpdump beside a real robot) is compared field by field with an emulator beside it; that
    they part is no error, so its exit code is 0.
    """
    from hil.replay.replay import Wish, replay_file

    elsewhere = beside or fri_version is not None or robot is not None or backend is not None
    pace = _pace(speed)
    output = JsonOutput(json_file)
    drawing = None
    if plot is not None:
        from hil.replay.drawing import Drawing

        drawing = Drawing(plot)
    with reading_bar("replay", file, shown=not output.alone and sys.stderr.isatty()) as progress:
        result = replay_file(
            file,
            wish=Wish(fri_version, robot, backend) if elsewhere else None,
            key_file=servo_key,
            progress=progress,
            pace=pace,
            update=update,
            watch=drawing,
        )
    output.write(result.as_dict())
    if drawing is not None:
        drawing.save(result)
    if not output.alone:
        _show(result, drawn=plot, update=update)
    if result.damage:
        raise typer.Exit(_UNREADABLE)
    if (result.own and not result.equal and not result.updated) or not (result.compared or result.extra):
        raise typer.Exit(_DIFFERENT)


def _pace(speed: str) -> Callable[[int], None] | None:
    if speed == _MAX:
        return None
    try:
        factor = float(speed)
    except ValueError:
        factor = 0.0
    if not 0.001 <= factor <= 1000.0:
        raise UsageError(f"--speed {speed}: valid is max, or a number of 0.001 to 1000 times real time")
    from hil.clock import Pause

    return Pause(factor).until


def _show(result: "ReplayResult", *, drawn: Path | None, update: bool) -> None:
    console = Console(highlight=False)
    colour = "green" if result.equal else "yellow" if not result.own else "red"
    # Sentences and paths are not broken where the output is a file: soft_wrap.
    console.print(f"[{colour}]{plain(result.verdict)}[/{colour}]", soft_wrap=True)
    for line in _remarks(result, update=update):
        console.print(plain(line), soft_wrap=True)
    if result.fields:
        console.print(_field_table(result))
        if len(result.fields) > _FIELDS_SHOWN:
            console.print(f"{len(result.fields) - _FIELDS_SHOWN} more fields differ; --json has them all")
    if result.states:
        console.print(_state_table(result))
    if drawn is not None:
        console.print(plain(f"picture: {drawn}"), soft_wrap=True)
    if result.damage:
        console.print(f"[red]{plain(result.damage)}[/red]; what is before that was replayed", soft_wrap=True)


def _remarks(result: "ReplayResult", *, update: bool) -> Iterator[str]:
    factor = result.real_time_factor
    if factor is not None:
        yield (
            f"replayed {result.recorded_s:.3f} s in {result.took_s:.2f} s, {factor:.1f} x real time; "
            f"{result.inputs} datagrams to the controller, {result.cycles} cycles"
        )
    if result.updated:
        yield "the recording holds now what the emulator says"
    elif update:
        yield "the recording was left as it was"
    for text in result.altered:
        yield f"changed after it was recorded: {text}"
    if result.own and not result.complete and not result.damage:
        yield "the recording was not ended in order: its process was killed, or the disk was full"
    for text in result.notes:
        yield f"note: {text}"
    if result.strangers:
        yield f"note: {result.strangers} datagrams are not between a controller and its FRI client"


def _field_table(result: "ReplayResult") -> Table:
    table = Table("field", "messages", "first at", "recorded", "emulator", "largest difference")
    for name, tally in list(result.fields.items())[:_FIELDS_SHOWN]:
        first = tally.first_difference
        # The distance between two states is no size of anything.
        is_measure = bool(tally.largest) and name != _SESSION_STATE
        largest = f"{tally.largest:.4g} {first.unit}".strip() if is_measure else ""
        table.add_row(
            name,
            str(tally.count),
            f"{tally.first.t_s:.3f} s",
            _value(name, first.recorded),
            _value(name, first.emulated),
            largest,
        )
    return table


def _state_table(result: "ReplayResult") -> Table:
    table = Table("robot", "t", "recording", "emulator", title="session states")
    for robot, whose, t_s, state in result.states:
        table.add_row(robot, f"{t_s:.3f} s", *((state, "") if whose == "recording" else ("", state)))
    return table


def _value(field: str, value: object) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, float):
        return f"{value:.9g}"
    if hasattr(value, "_fields"):
        return "something"  # a whole part of the message, that the other one has not
    if field == _SESSION_STATE and value in _STATE_NAMES:
        return _STATE_NAMES[value]
    return plain(str(value))
