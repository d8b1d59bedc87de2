"""``hil demo``: robot side, controller and application, three processes that talk UDP; ends with a picture."""

import json
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated, NamedTuple

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from hil.values.errors import ConfigurationError, EndpointError
from hil.values.fri import Release

_POLL_S = 0.1
_SECONDS = 10.0
_SECONDS_WITH_VIEW = 120.0
_SWING_WITH_VIEW = ("--amplitude", 0.15, "--frequency", 0.1)
_PERIOD_MS = 2
"""Four processes, the writer of the capture is one, on two cores: at 1 ms a busy machine loses the budget too often."""
_PERIOD_WITH_VIEW_MS = 20
"""A browser that draws without a GPU takes a core for itself, and two while it starts."""
_ROBOT_SIDE = "robot side"
_CONTROLLER = "controller"
_HIL_RUN = ("-m", "hil.cli.main", "run")
_LONGER_S = 10.0
"""What robot side and application have beside the controller's time, at most."""


def demo(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for status, capture, picture and logs.")] = Path(
        "out"
    ),
    seconds: Annotated[
        float | None, typer.Option(min=3.0, help="Length of the run; 10, with --view 120.", show_default=False)
    ] = None,
    robot: Annotated[str, typer.Option(help="Robot model.")] = "lbr-iiwa-14-r820",
    backend: Annotated[str, typer.Option(help="Robot side.")] = "mujoco",
    fri_version: Annotated[Release, typer.Option(help="FRI release of the client.")] = Release.V1_15,
    view: Annotated[bool, typer.Option("--view", help="Show it in a browser too, and be its operator.")] = False,
) -> None:
    """Let a sample FRI client move axis 4 of a simulated arm by a sine, over UDP at 500 Hz, and show what happened.

    The arm is a network peer behind FRI, as a Cabinet is; between it and the application stands the controller. With
    --view the arm is in the controller's process, and its client is told to answer every 20 ms.
    """
    from backends.registry import check_backend
    from backends.robots import load_description

    load_description(robot)
    check_backend(backend)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(f"cannot make the folder {out}: {error.strerror}") from error
    status, capture, picture = out / "status.json", out / "run.pcapng", out / "run.png"
    console = Console()
    what = _Demo(out, robot, backend, fri_version.value, seconds or (_SECONDS_WITH_VIEW if view else _SECONDS))
    commands = _seen(what) if view else _chained(what)
    for name, arguments in commands.items():
        console.print(f"{name + ':':12}python {' '.join(map(str, arguments))}", style="dim", soft_wrap=True)
    logs = {name: out / f"{name.replace(' ', '-')}.log" for name in commands}
    with ExitStack() as running:
        processes = {name: running.enter_context(_process(commands[name], logs[name])) for name in commands}
        controller = processes.pop(_CONTROLLER)
        _show_progress(controller, logs[_CONTROLLER], what.seconds, console if view else None)
        _expect_end(controller, _CONTROLLER, logs[_CONTROLLER])
        for name, process in processes.items():
            if name == _ROBOT_SIDE:
                process.send_signal(signal.SIGINT)
            _expect_end(process, name, logs[name])

    from hil.cli.summary import print_summary
    from tools.plot_run import plot_run

    figures = json.loads(status.read_text(encoding="utf-8"))
    with console.status("drawing"):
        plot_run(capture, figures, picture)
    print_summary(figures)
    of_robot_side = ("; robot-side.json: those of the robot side", "on both sides") if _ROBOT_SIDE in logs else ("", "")
    for file, content in (
        (picture, "commanded and measured motion, session states, answer latency"),
        (status, f"all figures of the controller{of_robot_side[0]}"),
        (
            capture,
            f"every packet of the controller{of_robot_side[1] and ', ' + of_robot_side[1]}; open it with Wireshark",
        ),
        (out / "client.json", "what the application saw"),
        (logs[_CONTROLLER], f"what the controller said; {_others(logs)}"),
    ):
        console.print(f"  {file}  [dim]{content}[/dim]", highlight=False)


class _Demo(NamedTuple):
    """What is demonstrated."""

    out: Path
    robot: str
    backend: str
    release: str
    seconds: float


def _chained(what: _Demo) -> dict[str, list[object]]:
    """The arm is a network peer behind FRI."""
    from transport.udp import free_port

    robot_port, client_port = free_port("127.0.0.1"), free_port("127.0.0.1")
    period = ("--cycle", _PERIOD_MS, "--send-period", _PERIOD_MS)
    quiet = ("--servo", "off", "--pad", "off", "--progress", 0, *period)
    robot_side = [
        *(*_HIL_RUN, "--robot", what.robot, "--backend", what.backend, "--fri-version", what.release),
        *("--fri-client", f"127.0.0.1:{robot_port}", *quiet, "--duration", what.seconds + _LONGER_S),
        *("--status-json", what.out / "robot-side.json"),
    ]
    side = ("cabinet", "-o", f"release={what.release}", "-o", f"bind=127.0.0.1:{robot_port}")
    return {
        _ROBOT_SIDE: robot_side,
        "application": _application(what, client_port),
        _CONTROLLER: _controller(what, client_port, side, quiet),
    }


def _seen(what: _Demo) -> dict[str, list[object]]:
    """The arm is in the controller's process, and the client has time to answer: a browser takes what it can get."""
    from transport.udp import free_port

    servo_port, client_port = free_port("127.0.0.1"), free_port("127.0.0.1")
    options = ("--servo", f"127.0.0.1:{servo_port}", "--progress", 0, "--send-period", _PERIOD_WITH_VIEW_MS, "--view")
    return {
        "application": [*_application(what, client_port), *_SWING_WITH_VIEW],
        _CONTROLLER: _controller(what, client_port, (what.backend,), options),
    }


def _controller(what: _Demo, client_port: int, backend: Sequence[object], options: Sequence[object]) -> list[object]:
    return [
        *(*_HIL_RUN, "--robot", what.robot, "--backend", *backend, "--fri-version", what.release),
        *("--fri-client", f"127.0.0.1:{client_port}", *options, "--duration", what.seconds),
        *("--status-json", what.out / "status.json", "--capture", what.out / "run.pcapng"),
    ]


def _application(what: _Demo, client_port: int) -> list[object]:
    return [
        *("-m", "apps.fri_joint_sine", "--fri-version", what.release, "--bind", "127.0.0.1", "--port", client_port),
        *("--seconds", what.seconds + _LONGER_S, "--json", what.out / "client.json"),
    ]


def _others(logs: Mapping[str, Path]) -> str:
    others = [log.name for name, log in logs.items() if name != _CONTROLLER]
    return f"{' and '.join(others)}: the other{'s' if len(others) > 1 else ''}"


@contextmanager
def _process(arguments: Sequence[object], log: Path) -> Iterator["subprocess.Popen[bytes]"]:
    with log.open("wb") as stream:
        process = subprocess.Popen([sys.executable, *map(str, arguments)], stdout=stream, stderr=subprocess.STDOUT)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
            try:
                process.wait(5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _show_progress(
    controller: "subprocess.Popen[bytes]", log: Path, seconds: float, says_view_to: Console | None
) -> None:
    """Show how far it is; ``says_view_to`` is told where the page is, once the controller says so."""
    columns = (BarColumn(), TimeElapsedColumn(), TextColumn("{task.description}"))
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("starting", total=seconds + 1)
        waited_s = 0.0
        while waited_s < seconds + 30:
            try:
                controller.wait(_POLL_S)
            except subprocess.TimeoutExpired:
                waited_s += _POLL_S
                if says_view_to is not None and (lines := _lines_about_view(log)):
                    for line in lines:
                        says_view_to.print(line, highlight=False, soft_wrap=True)
                    says_view_to = None
                bar.update(task, completed=min(waited_s, seconds + 1), description=_last_state(log))
            else:
                bar.update(task, completed=seconds + 1)
                return


def _lines_about_view(log: Path) -> list[str]:
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    about = [line for line in lines if line.startswith("view: ")]
    return about if any("?websocket=" in line for line in about) else []


def _last_state(log: Path) -> str:
    lines = [line for line in log.read_text(encoding="utf-8", errors="replace").splitlines() if " -> " in line]
    return lines[-1].partition(": ")[2].partition(":")[0] if lines else "starting"


def _expect_end(process: "subprocess.Popen[bytes]", name: str, log: Path) -> None:
    try:
        code = process.wait(20)
    except subprocess.TimeoutExpired:
        raise EndpointError(f"the {name} did not end; see {log}") from None
    if code != 0:
        said = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        raise EndpointError(f"the {name} ended with exit code {code}: {said[-1] if said else 'it said nothing'}")
