"""``hil run``: be the controller, until Ctrl-C or the duration ends it."""

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from hil.cli.shadow import DEFAULT_ROBOT
from hil.config.control import ControlName
from hil.config.station import Mode, Reaction, Station, load_station, parse_station
from hil.values.errors import ConfigurationError, UnknownName
from hil.values.fri import CLIENT_PORT, OverlayKind, Release
from hil.values.tcp_probe import Behaviour
from transport.udp import ANY_HOST, parse_address

if TYPE_CHECKING:
    from hil.runtime.view_process import ViewPlace

_ENDPOINTS = ("client", "bind")
"""Options that name an address: they cannot hold for several robots at once."""
_OFF = "off"


def run(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    station: Annotated[
        Path | None, typer.Argument(help="Station file (TOML); options override it. See: hil config init")
    ] = None,
    robot: Annotated[str | None, typer.Option(help="Robot model, such as lbr-iiwa-14-r820 (the default).")] = None,
    backend: Annotated[
        str | None, typer.Option(help="Robot side: mujoco (the default), ideal, cabinet, can402 ...: hil backends.")
    ] = None,
    option: Annotated[
        list[str] | None,
        typer.Option("--option", "-o", metavar="NAME=VALUE", help="Option of the backend, as often as needed."),
    ] = None,
    shadow: Annotated[
        bool, typer.Option("--shadow", help="With --backend cabinet: only watch and compare, as hil shadow does.")
    ] = False,
    cycle_ms: Annotated[
        int | None, typer.Option("--cycle", metavar="MS", help="Control cycle: 1 (the default), 2, 4 or 5 ms.")
    ] = None,
    mode: Annotated[Mode | None, typer.Option(help="Operation mode; AUT is the default.")] = None,
    enabled: Annotated[
        bool, typer.Option("--enabled", help="Begin T1 or T2 with the enabling switch held and start pressed.")
    ] = False,
    permissive: Annotated[
        bool, typer.Option("--permissive", help="Monitors only report what would have stopped the arm.")
    ] = False,
    fri_client: Annotated[
        str | None,
        typer.Option(metavar="HOST[:PORT]|off", help="Where the FRI client listens; 127.0.0.1:30200."),
    ] = None,
    fri_bind: Annotated[
        str | None,
        typer.Option(
            metavar="ADDR[:PORT]",
            help="Where the client is served from. A client that was given the controller's name hears only its own "
            "port number: 127.0.0.2:30200 serves one on this machine that is bound to 127.0.0.1.",
        ),
    ] = None,
    fri_version: Annotated[
        Release | None, typer.Option(help="Release of the client's FRI library; 1.15 is the default.")
    ] = None,
    send_period: Annotated[int | None, typer.Option(metavar="MS", help="Send period, 1..100 ms; 1.")] = None,
    receive_multiplier: Annotated[int | None, typer.Option(metavar="N", help="Client answers every n-th; 1.")] = None,
    overlay: Annotated[OverlayKind | None, typer.Option(help="What the client may command; joint-position.")] = None,
    control: Annotated[
        ControlName | None,
        typer.Option(help="Control of the arm while the client commands; what the overlay needs, else position."),
    ] = None,
    servo: Annotated[
        str | None,
        typer.Option(metavar="ADDR[:PORT]|off", help="Where applications connect to; 127.0.0.1:30300."),
    ] = None,
    servo_key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Pre-shared key of the servo link; see: hil config key")
    ] = None,
    reaction: Annotated[
        Reaction | None, typer.Option(help="Reaction time of servo motions; cabinet: 22 and 12 ms, ideal: none.")
    ] = None,
    kst: Annotated[
        str | None,
        typer.Option(metavar="ADDR[:PORT]|off", help="Serve KST programs (MATLAB, Python) over TCP; port 30001."),
    ] = None,
    kst_strict: Annotated[
        bool, typer.Option("--kst-strict", help="Do as a published KST server does, its faults included.")
    ] = False,
    kst_nagle: Annotated[
        bool, typer.Option("--kst-nagle", help="Leave Nagle's algorithm on, as a published KST server does.")
    ] = False,
    pad: Annotated[
        str | None, typer.Option(metavar="SOCKET|off", help="Where hil pad finds this controller; chosen unless given.")
    ] = None,
    capture: Annotated[Path | None, typer.Option(metavar="FILE.pcapng", help="Record all packets.")] = None,
    capture_ring: Annotated[
        str | None, typer.Option(metavar="FILESxSIZE", help="Keep only the newest files of it, such as 10x100MB.")
    ] = None,
    tcp_probe: Annotated[
        str | None, typer.Option(metavar="ADDR:PORT|off", help="Serve a responder for hil doctor tcp there.")
    ] = None,
    tcp_probe_behaviour: Annotated[
        Behaviour | None,
        typer.Option(help="What kind of peer it is: good (the default), or a bad one; the last is emulated."),
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Show it in a browser too, as hil view does.")] = False,
    view_at: Annotated[
        str | None,
        typer.Option(metavar="ADDR[:PORT]", help="Where that page is; 127.0.0.1:8080, or the next free port."),
    ] = None,
    duration: Annotated[float | None, typer.Option(metavar="S", min=0.0, help="End after so many seconds.")] = None,
    status_json: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the run's figures at exit.")] = None,
    progress: Annotated[
        float, typer.Option(metavar="S", min=0.0, help="Seconds between progress lines; 0: none.")
    ] = 1.0,
    realtime: Annotated[bool, typer.Option("--realtime", help="Ask for SCHED_FIFO, locked memory, a CPU.")] = False,
    settle: Annotated[
        float, typer.Option(metavar="S", min=0.0, hidden=True, help="Leave the first seconds out of rate and lateness.")
    ] = 0.0,
) -> None:
    """Serve FRI clients and servo applications. Ctrl-C brakes the arm, closes the sessions, and reports."""
    if shadow:
        _shadow(backend, backend_options(option or []), robot=robot, seconds=duration)
        return
    overrides = {
        "model": robot,
        "backend": backend,
        "mode": mode,
        "enabled": enabled or None,
        "permissive": permissive or None,
        "cycle_ms": cycle_ms,
        "options": backend_options(option or []) or None,
    }
    fri = {
        "client": fri_client,
        "bind": fri_bind,
        "release": fri_version,
        "send_period_ms": send_period,
        "receive_multiplier": receive_multiplier,
        "overlay": overlay,
        "control": None if control is None else {"mode": control},
    }
    chosen = station_of(
        station,
        robot=_given(overrides),
        fri=_given(fri),
        servo=ServoOptions(servo, servo_key, reaction),
        kst=_given({"bind": kst, "strict": kst_strict or None, "nagle": kst_nagle or None}),
        process=_given({"capture": capture, "capture_ring": capture_ring, "pad": pad, "realtime": realtime or None}),
        tcp_probe=_given({"bind": tcp_probe, "behaviour": tcp_probe_behaviour}),
    )
    for note in chosen_controls(chosen):
        typer.echo(note, err=True)
    from hil.cli.summary import print_summary
    from hil.runtime.run import RunOptions, run_station

    result = run_station(
        chosen,
        RunOptions(
            duration_s=duration,
            status_json=status_json,
            progress_s=progress,
            view=_view_place(view, view_at, station),
            settle_s=settle,
        ),
    )
    print_summary(result.status)
    if result.fault is not None:
        raise typer.Exit(1)


def _view_place(view: bool, at: str | None, station: Path | None) -> "ViewPlace | None":
    from hil.runtime.view_process import ViewPlace

    if at is not None:
        address = parse_address(at, default_port=ViewPlace().port)
        return ViewPlace(address.host, address.port, station)
    return ViewPlace(station=station) if view else None


def _shadow(backend: str | None, options: dict[str, Any], *, robot: str | None, seconds: float | None) -> None:
    """Watch a Cabinet, beside an emulated arm."""
    from hil.cli.shadow import shadow

    if backend != "cabinet":
        raise ConfigurationError(f"--shadow watches a Cabinet: it needs --backend cabinet, not {backend or 'mujoco'}")
    unknown = set(options) - {"bind", "cabinet", "release", "connect_s"}
    if unknown:
        raise ConfigurationError(f"--shadow has no use for the option {min(unknown)!r}")
    release = str(options.get("release", Release.V1_15))
    if release not in [*Release]:
        raise UnknownName("release", release, [*Release])
    shadow(
        bind=str(options.get("bind", f"{ANY_HOST}:{CLIENT_PORT}")),
        cabinet=options.get("cabinet"),
        fri_version=Release(release),
        robot=robot or DEFAULT_ROBOT,
        seconds=seconds,
        connect_s=float(options.get("connect_s", 10.0)),
    )


def chosen_controls(station: Station) -> list[str]:
    """Return a line for each robot whose control mode was not given, where its overlay needs one."""
    notes = []
    for robot in station.robot:
        fri = robot.fri
        if fri is None or fri.control.mode is not None:
            continue
        name = fri.control.name_for(fri.overlay)
        if name is not ControlName.POSITION:
            parameters = "as set" if fri.control.model_fields_set else "of default stiffness and damping"
            notes.append(f"{robot.name}: a {fri.overlay} overlay needs {name}; taken, {parameters}")
    return notes


class ServoOptions(NamedTuple):
    """Options of the servo link: where to bind (``off`` for no link), its key, the reaction time."""

    bind: str | None = None
    key_file: Path | None = None
    reaction: Reaction | None = None


def station_of(
    path: Path | None,
    *,
    robot: dict[str, Any],
    fri: dict[str, Any],
    servo: ServoOptions,
    process: dict[str, Any],
    kst: dict[str, Any] | None = None,
    tcp_probe: dict[str, Any] | None = None,
) -> Station:
    """Return the station of a file (or one default robot with both links) with options laid over it."""
    content: dict[str, Any] = {"robot": [{"fri": {}, "servo": {}}]}
    if path is not None:
        content = load_station(path).model_dump(exclude_unset=True)
    robots = content["robot"]
    for one in robots:
        options = {**one.get("options", {}), **robot.get("options", {})}
        one.update(robot)
        if options:
            one["options"] = options
    _lay_fri_options(robots, fri, path)
    _lay_servo_options(robots, servo, path)
    _lay_kst_options(robots, kst or {}, path)
    content.update(process)
    _lay_probe_options(content, tcp_probe or {})
    return parse_station(content, where="command line" if path is None else f"{path} with the options given")


def backend_options(texts: list[str]) -> dict[str, Any]:
    """Return ``NAME=VALUE`` texts as a table; a value is TOML where it is that, else the text itself."""
    options: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise ConfigurationError(f"--option {text!r}: NAME=VALUE is needed, such as release=2.5")
        try:
            options[name] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            options[name] = value
    return options


def _lay_fri_options(robots: list[dict[str, Any]], fri: dict[str, Any], path: Path | None) -> None:
    if fri.get("client") == _OFF:
        if len(fri) > 1:
            raise ConfigurationError("--fri-client off leaves nothing for the other FRI options to say")
        for one in robots:
            one["fri"] = None
        return
    if len(robots) > 1 and (several := [name for name in _ENDPOINTS if name in fri]):
        raise ConfigurationError(
            f"{path} has {len(robots)} robots, and --fri-{several[0]} can be that of one only: set it in the file"
        )
    linked = robots if "client" in fri else [one for one in robots if one.get("fri") is not None]
    if fri and not linked:
        raise ConfigurationError(f"no robot of {path} has an FRI link for the FRI options; add --fri-client")
    for one in linked:
        before = one.get("fri") or {}
        one["fri"] = {**before, **fri}
        if "control" in fri:
            one["fri"]["control"] = {**before.get("control", {}), **fri["control"]}


def _lay_servo_options(robots: list[dict[str, Any]], servo: ServoOptions, path: Path | None) -> None:
    if servo.reaction is not None:
        for one in robots:
            one["reaction"] = {**(one.get("reaction") or {}), "profile": servo.reaction}
    if servo.bind == _OFF:
        if servo.key_file is not None:
            raise ConfigurationError("--servo off leaves nothing for --servo-key to protect")
        for one in robots:
            one["servo"] = None
        return
    given = _given({"bind": servo.bind, "key_file": servo.key_file})
    if servo.bind is not None and len(robots) > 1:
        raise ConfigurationError(f"{path} has {len(robots)} robots, and --servo can be that of one only: set it there")
    linked = robots if servo.bind is not None else [one for one in robots if one.get("servo") is not None]
    if given and not linked:
        raise ConfigurationError(f"no robot of {path} has a servo link for --servo-key; add --servo")
    for one in linked:
        one["servo"] = {**(one.get("servo") or {}), **given}


def _lay_kst_options(robots: list[dict[str, Any]], kst: dict[str, Any], path: Path | None) -> None:
    if not kst:
        return
    if kst.get("bind") == _OFF:
        if len(kst) > 1:
            raise ConfigurationError("--kst off leaves nothing for the other KST options to say")
        for one in robots:
            one["kst"] = None
        return
    if "bind" in kst and len(robots) > 1:
        raise ConfigurationError(f"{path} has {len(robots)} robots, and --kst can be that of one only: set it there")
    linked = robots if "bind" in kst else [one for one in robots if one.get("kst") is not None]
    if not linked:
        raise ConfigurationError("there is no KST server for the KST options; add --kst ADDR[:PORT]")
    for one in linked:
        one["kst"] = {**(one.get("kst") or {}), **kst}


def _lay_probe_options(content: dict[str, Any], probe: dict[str, Any]) -> None:
    if not probe:
        return
    if probe.get("bind") == _OFF:
        if len(probe) > 1:
            raise ConfigurationError("--tcp-probe off leaves nothing for --tcp-probe-behaviour to say")
        content["tcp_probe"] = None
        return
    before = content.get("tcp_probe") or {}
    if "bind" not in {*before, *probe}:
        raise ConfigurationError("--tcp-probe-behaviour needs a responder; add --tcp-probe ADDR:PORT")
    content["tcp_probe"] = {**before, **probe}


def _given(options: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in options.items() if value is not None}
