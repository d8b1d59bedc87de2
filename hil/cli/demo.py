"""``hil demo``: robot side, controller and application, three processes that talk UDP; ends with a picture."""

import json
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

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
_PERIOD_WITH_VIEW_MS = 5
"""A browser that draws without a GPU takes a core for itself."""
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

    The arm is a network peer behind FRI, as a Cabinet is; between it and the application stands the controller.
    """
    from backends.registry import check_backend
    from backends.robots import load_description
    from transport.udp import free_port

    load_description(robot)
    check_backend(backend)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(f"cannot make the folder {out}: {error.strerror}") from error
    status, capture, picture = out / "status.json", out / "run.pcapng", out / "run.png"
    console = Console()
    robot_port, client_port = free_port("127.0.0.1"), free_port("127.0.0.1")
    release = fri_version.value
    seconds = seconds or (_SECONDS_WITH_VIEW if view else _SECONDS)
    period_ms = _PERIOD_WITH_VIEW_MS if view else _PERIOD_MS
    period = ("--cycle", period_ms, "--send-period", period_ms)
    quiet = ("--servo", "off", "--pad", "off", "--progress", 0, *period)
    seen = ("--servo", f"127.0.0.1:{free_port('127.0.0.1')}", "--progress", 0, *period, "--view")
    swing = _SWING_WITH_VIEW if view else ()
    commands = {
        "robot side": [
            *("-m", "hil.cli.main", "run", "--robot", robot, "--backend", backend, "--fri-version", release),
            *("--fri-client", f"127.0.0.1:{robot_port}", *quiet, "--duration", seconds + _LONGER_S),
            *("--status-json", out / "robot-side.json"),
        ],
        "controller": [
            *("-m", "hil.cli.main", "run", "--robot", robot, "--backend", "cabinet", "-o", f"release={release}"),
            *("-o", f"bind=127.0.0.1:{robot_port}", "--fri-version", release, "--fri-client"),
            *(f"127.0.0.1:{client_port}", *(seen if view else quiet), "--duration", seconds, "--status-json", status),
            *("--capture", capture),
        ],
        "application": [
            *("-m", "apps.fri_joint_sine", "--fri-version", release, "--bind", "127.0.0.1"),
            *("--port", client_port, "--seconds", seconds + _LONGER_S, "--json", out / "client.json", *swing),
        ],
    }
    for name, arguments in commands.items():
        console.print(f"{name + ':':12}python {' '.join(map(str, arguments))}", style="dim", soft_wrap=True)
    logs = {name: out / f"{name.replace(' ', '-')}.log" for name in commands}
    with (
        _process(commands["robot side"], logs["robot side"]) as robot_side,
        _process(commands["application"], logs["application"]) as application,
        _process(commands["controller"], logs["controller"]) as controller,
    ):
        _show_progress(controller, logs["controller"], seconds, console if view else None)
        _expect_end(controller, "controller", logs["controller"])
        _expect_end(application, "application", logs["application"])
        robot_side.send_signal(signal.SIGINT)
        _expect_end(robot_side, "robot side", logs["robot side"])

    from hil.cli.summary import print_summary
    from tools.plot_run import plot_run

    figures = json.loads(status.read_text(encoding="utf-8"))
    with console.status("drawing"):
        plot_run(capture, figures, picture)
    print_summary(figures)
    for file, what in (
        (picture, "commanded and measured motion, session states, answer latency"),
        (status, "all figures of the controller; robot-side.json: those of the robot side"),
        (capture, "every packet of the controller, on both sides; open it with Wireshark"),
        (out / "client.json", "what the application saw"),
        (logs["controller"], "what the controller said; robot-side.log and application.log: the other two"),
    ):
        console.print(f"  {file}  [dim]{what}[/dim]", highlight=False)


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
