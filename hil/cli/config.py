"""``hil config``: write, check and describe station files."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from hil.config.station import RobotConfig, Station, load_station
from hil.config.template import TEMPLATE
from hil.values.errors import ConfigurationError

if TYPE_CHECKING:
    from hil.runtime.assembly import LinkAddresses

app = typer.Typer(help="Write, check and describe station files.", no_args_is_help=True)


@app.command()
def init(file: Annotated[Path, typer.Argument(help="File to write.")] = Path("station.toml")) -> None:
    """Write a commented station file with all defaults. Never overwrites one."""
    try:
        with file.open("x", encoding="utf-8") as stream:
            stream.write(TEMPLATE)
    except FileExistsError:
        raise ConfigurationError(f"{file} is there already; give another name") from None
    except OSError as error:
        raise ConfigurationError(f"cannot write {file}: {error.strerror}") from error
    typer.echo(f"wrote {file}; run it with: hil run {file}")


@app.command()
def check(file: Annotated[Path, typer.Argument(help="Station file to check.")]) -> None:
    """Check a station file, addresses and names included, and show what it means."""
    station = load_station(file)
    from backends.registry import check_backend
    from hil.runtime.assembly import link_addresses, robot_description

    if station.tcp_probe is not None:
        from transport.tcp.sockets import parse_tcp_address

        parse_tcp_address(station.tcp_probe.bind, port_0=True)
    table = Table("", *(escape(robot.name) for robot in station.robot), title=escape(str(file)))
    columns = []
    for robot in station.robot:
        robot_description(robot)
        check_backend(robot.backend, robot.options)
        addresses = link_addresses(robot)
        rows = {
            "model": robot.model,
            "backend": f"{robot.backend}{_options(robot)}",
            "mode": f"{robot.mode.value}{', enabled' if robot.enabled else ''}",
            "limits": _limits(robot),
            "cycle": f"{robot.cycle_ms} ms, overrun {robot.overrun}",
        }
        if robot.tool or robot.frame:
            rows["frames"] = escape(_frames(robot))
        if robot.fri is not None and addresses.fri is not None:
            rows |= {
                "FRI client": f"{addresses.fri.peer}, release {robot.fri.release}",
                "served from": "any free port" if addresses.fri.bind.port == 0 else str(addresses.fri.bind),
                "send period": f"{robot.fri.send_period_ms} ms, receive multiplier {robot.fri.receive_multiplier}",
                "overlay": f"{robot.fri.overlay}, control {robot.fri.control.name_for(robot.fri.overlay)}",
            }
            if robot.fri.transformations:
                rows["transformations"] = ", ".join(robot.fri.transformations)
        if signals := robot.signals():
            rows["inputs, outputs"] = f"{len(signals)}, {sum(signal.fri for signal in signals)} of them over FRI"
        rows |= _applications(robot, addresses)
        columns.append(rows)
    for label in dict.fromkeys(label for rows in columns for label in rows):
        table.add_row(label, *(rows.get(label, "-") for rows in columns))
    console = Console()
    console.print(table)
    if station.object:
        console.print(_objects(station))
    typer.echo(f"{file} is good")


def _applications(robot: RobotConfig, addresses: "LinkAddresses") -> dict[str, str]:
    from hil.runtime.assembly import make_servo_codec

    rows = {}
    if robot.servo is not None and addresses.servo is not None:
        make_servo_codec(robot.servo)
        reaction = robot.reaction.settings()
        rows = {
            "applications": f"{addresses.servo}, {'with a key' if robot.servo.key_file else 'no key'}",
            "reaction time": f"SmartServo {reaction.smart_servo_ms:g} ms, DirectServo {reaction.direct_servo_ms:g} ms",
        }
    if robot.kst is not None:
        rows["KST programs"] = f"{addresses.kst}{', strictly as published' if robot.kst.strict else ''}"
    return rows


def _options(robot: RobotConfig) -> str:
    return "".join(f", {escape(name)} = {escape(str(value))}" for name, value in robot.options.items())


def _objects(station: Station) -> Table:
    table = Table("object", "shape", "size, mm", "at, mm", "mass", title="what MuJoCo arms can touch")
    for one in station.object:
        size = " x ".join(f"{value:g}" for value in one.size_mm) or "-"
        at = f"{one.x_mm:g}, {one.y_mm:g}, {one.z_mm:g}"
        table.add_row(one.name, one.shape, size, at, "stands fast" if one.mass_kg is None else f"{one.mass_kg:g} kg")
    return table


def _limits(robot: RobotConfig) -> str:
    tightened = ", ".join(sorted(robot.limits.model_fields_set))
    text = f"tightened: {tightened}" if tightened else "the robot's own"
    return f"{text}; PERMISSIVE: monitors only report" if robot.permissive else text


def _frames(robot: RobotConfig) -> str:
    tree = robot.frames()
    moving = [name for name, frame in tree.items() if frame.moves]
    return f"still: {', '.join(name for name in tree if name not in moving)}; moving: {', '.join(moving)}"


@app.command()
def schema() -> None:
    """Print the JSON schema of station files."""
    typer.echo(json.dumps(Station.model_json_schema(), indent=2))


@app.command()
def key(file: Annotated[Path, typer.Argument(help="File to write; only its owner may read it.")]) -> None:
    """Write a new pre-shared key for the servo link. Never overwrites a file."""
    from transport.servo import write_key

    write_key(file)
    typer.echo(f"wrote {file}; both sides need it: key_file in the station file, and the application's key")
