"""``hil pad``: the operator's pad of a running controller."""

import contextlib
import json
import math
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from hil.client.pad import PadClient, PadRefused, RobotState
from hil.values.arm import DEFAULT_PUSH_S
from hil.values.errors import EndpointError
from hil.values.robot import JOINT_COUNT

app = typer.Typer(
    help="The operator's pad of a running controller: mode, keys, emergency stop, override, and pushes of the arm.",
    no_args_is_help=True,
)

Socket = Annotated[
    Path | None, typer.Option("--socket", metavar="PATH", help="Socket of the controller; your only one is found.")
]
Robot = Annotated[str | None, typer.Option("--robot", metavar="NAME", help="Robot, where the controller has several.")]
_REFUSED = 1
_CLOSED = "the controller closed the connection"


class _Mode(StrEnum):
    """Operation mode."""

    T1 = "T1"
    T2 = "T2"
    AUT = "AUT"


@app.command()
def mode(
    mode: Annotated[_Mode, typer.Argument(help="Operation mode.")], socket: Socket = None, robot: Robot = None
) -> None:
    """Turn the mode selector. Motions pause; one that moves is stopped."""
    _act(socket, robot, lambda pad: pad.select_mode(mode.value))


@app.command()
def enable(
    hold: Annotated[
        bool, typer.Option("--hold", help="Hold it until Ctrl-C or the end of the input, and no longer than this runs.")
    ] = False,
    socket: Socket = None,
    robot: Robot = None,
) -> None:
    """Hold the enabling switch, which T1 and T2 need."""
    if not hold:
        _act(socket, robot, lambda pad: pad.enable())
        return
    with _refusals(), PadClient(socket, robot=robot) as pad:
        _print_lines(pad.enable(hold=True))
        _say("holding the enabling switch until Ctrl-C or the end of the input")
        ended = threading.Event()
        threading.Thread(target=_end_with_input, args=(pad, ended), daemon=True).start()
        why = _held(pad, robot)
        if not ended.is_set() and why:
            _say(why)
            raise typer.Exit(_REFUSED)
    _say("the enabling switch is let go")


@app.command()
def release(socket: Socket = None, robot: Robot = None) -> None:
    """Let the enabling switch go."""
    _act(socket, robot, lambda pad: pad.release())


@app.command()
def start(socket: Socket = None, robot: Robot = None) -> None:
    """Press the start key: motions run, or go on."""
    _act(socket, robot, lambda pad: pad.start())


@app.command()
def pause(socket: Socket = None, robot: Robot = None) -> None:
    """Let the start key go: motions brake on their path, and wait."""
    _act(socket, robot, lambda pad: pad.pause())


@app.command()
def estop(socket: Socket = None, robot: Robot = None) -> None:
    """Press the emergency stop; of all robots unless one is named."""
    _act(socket, robot, lambda pad: pad.emergency_stop())


@app.command()
def reset(socket: Socket = None, robot: Robot = None) -> None:
    """Pull the emergency stop out, and acknowledge the stop."""
    _act(socket, robot, lambda pad: pad.reset())


@app.command()
def override(
    percent: Annotated[float, typer.Argument(help="Program override, 0..100 %.")],
    socket: Socket = None,
    robot: Robot = None,
) -> None:
    """Set the program override, which scales the speed of motions."""
    _act(socket, robot, lambda pad: pad.set_override(percent))


@app.command(context_settings={"ignore_unknown_options": True})
def push(
    force: Annotated[
        tuple[float, float, float], typer.Argument(metavar="FX FY FZ", help="Force in N, axes of the robot base.")
    ],
    *,
    link: Annotated[int, typer.Option(help="Link whose outer end is pushed, 1..7; 7: the flange.")] = JOINT_COUNT,
    moment: Annotated[
        tuple[float, float, float], typer.Option(metavar="MX MY MZ", help="Moment about the same axes, Nm.")
    ] = (0.0, 0.0, 0.0),
    seconds: Annotated[float, typer.Option(help="How long.")] = DEFAULT_PUSH_S,
    socket: Socket = None,
    robot: Robot = None,
) -> None:
    """Push a simulated arm; a new push replaces the one before."""
    _act(socket, robot, lambda pad: pad.push(force, link=link, moment_nm=moment, duration_s=seconds))


@app.command(context_settings={"ignore_unknown_options": True})
def io(
    name: Annotated[str | None, typer.Argument(help="Input or output, Group.Name; none: all.")] = None,
    value: Annotated[str | None, typer.Argument(help="New value of an input: true, false or a number.")] = None,
    socket: Socket = None,
    robot: Robot = None,
) -> None:
    """List inputs and outputs, or set an input."""
    number = None if value is None else _signal_value(value)
    with _refusals(), PadClient(socket, robot=robot) as pad:
        robots = pad.status() if name is None or number is None else pad.set_input(name, number)
    found = [line for key, state in robots.items() for line in _signal_lines(key, state, name)]
    for line in found:
        typer.echo(line)
    if name is not None and not found:
        names = ", ".join(sorted({one for state in robots.values() for one in state["io"]}))
        _say(f"there is no input or output {name!r}; valid: {names or 'none'}")
        raise typer.Exit(_REFUSED)


@app.command()
def status(
    as_json: Annotated[bool, typer.Option("--json", help="Print it as JSON.")] = False,
    socket: Socket = None,
    robot: Robot = None,
) -> None:
    """Show what the pad shows."""
    with _refusals(), PadClient(socket, robot=robot) as pad:
        robots = pad.status()
    if as_json:
        typer.echo(json.dumps(robots, indent=2))
        return
    from rich.console import Console

    from hil.cli.pad_table import pad_table

    Console().print(pad_table(robots))


@app.command()
def watch(socket: Socket = None, robot: Robot = None) -> None:
    """Show every change until Ctrl-C: a table on a terminal, else a line a change."""
    with _refusals(), PadClient(socket, robot=robot) as pad, contextlib.suppress(KeyboardInterrupt):
        if sys.stdout.isatty():
            _watch_table(pad)
        else:
            _watch_lines(pad)
        _say(_CLOSED)
        raise typer.Exit(_REFUSED)


def _act(socket: Path | None, robot: str | None, action: Callable[[PadClient], dict[str, RobotState]]) -> None:
    with _refusals(), PadClient(socket, robot=robot) as pad:
        _print_lines(action(pad))


@contextmanager
def _refusals() -> Iterator[None]:
    """What the controller refuses goes to standard error, in its words, and ends with exit code 1."""
    try:
        yield
    except PadRefused as refused:
        for line in (str(refused), *(_line(name, state) for name, state in refused.robots.items())):
            _say(line)
        raise typer.Exit(_REFUSED) from None


def _signal_value(text: str) -> bool | int | float:
    if text in {"true", "false"}:
        return text == "true"
    try:
        return int(text)
    except ValueError:
        pass
    with contextlib.suppress(ValueError):
        number = float(text)
        if math.isfinite(number):
            return number
    raise typer.BadParameter(f"{text!r} is neither true, false nor a finite number", param_hint="VALUE")


def _signal_lines(robot: str, state: RobotState, name: str | None) -> list[str]:
    return [
        f"{robot}: {signal} {info['type']} {info['direction']} {json.dumps(info['value'])}"
        for signal, info in state["io"].items()
        if name in {None, signal}
    ]


def _print_lines(robots: dict[str, RobotState]) -> None:
    for name, state in robots.items():
        typer.echo(_line(name, state))


def _line(name: str, state: RobotState) -> str:
    """Return a robot's state in one line."""
    parts = ["PERMISSIVE"] if state["permissive"] else []
    parts += [state["mode"], state["program"]]
    if state["mode"] != _Mode.AUT:
        parts.append(f"enabling {'held' if state['enabling'] else 'not held'}")
    parts += [f"drives {state['drives']}", f"override {state['override_percent']:g} %"]
    reason = f"; {state['reason']}" if state["reason"] else ""
    return f"{name}: {', '.join(parts)}{reason}"


def _held(pad: PadClient, robot: str | None) -> str:
    """Wait while the switch is held; return why it no longer is, empty after Ctrl-C."""
    try:
        for robots in pad.states():
            state = robots[robot] if robot is not None else next(iter(robots.values()))
            if not state["enabling"]:
                return "the enabling switch was let go by another pad"
    except KeyboardInterrupt:
        return ""
    except (EndpointError, PadRefused) as error:
        return str(error)
    return _CLOSED


def _end_with_input(pad: PadClient, ended: threading.Event) -> None:
    # Not through sys.stdin, whose lock a thread that reads would hold at the end of the interpreter.
    with contextlib.suppress(OSError):
        while os.read(0, 4096):
            pass
    ended.set()
    with contextlib.suppress(OSError):
        pad.interrupt()


def _watch_lines(pad: PadClient) -> None:
    shown: dict[str, str] = {}
    for robots in pad.states():
        for name, state in robots.items():
            line = _watch_line(name, state)
            if shown.get(name) != line:
                shown[name] = line
                typer.echo(f"[{state['time_s']:9.3f} s] {line}")


def _watch_line(name: str, state: RobotState) -> str:
    from hil.cli.pad_table import stop_text

    line = _line(name, state)
    if state["session"] is not None:
        line += f" | {state['session']['state']} {state['session']['quality']}"
    if state["commander"]:
        line += f" | commanded by {state['commander']}"
    return f"{line} | last stop {stop_text(state)}" if state["last_stop"] is not None else line


def _watch_table(pad: PadClient) -> None:
    from rich.live import Live

    from hil.cli.pad_table import pad_table

    with Live(auto_refresh=False) as live:
        for robots in pad.states():
            live.update(pad_table(robots), refresh=True)


def _say(line: str) -> None:
    typer.echo(line, err=True)
