"""``hil snapshot``: robots as a picture, drawn off screen."""

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.config.station import RobotConfig, ServoConfig, Station, load_station
from hil.values.errors import ConfigurationError
from hil.values.link import Address

if TYPE_CHECKING:
    from hil.values.robot import Seven

_MOST_PIXELS = 4096
_LEAST_PIXELS = 16
_ANY_ADDRESS = "0.0.0.0"  # noqa: S104  # nothing is bound: that a station does so is what this is compared with
_THIS_MACHINE = "127.0.0.1"


def snapshot(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FILE.png", help="The picture.")],
    station: Annotated[
        Path | None, typer.Argument(metavar="STATION", help="Station file: its robots and objects. Default: one arm.")
    ] = None,
    robot: Annotated[str | None, typer.Option(help="Robot model, without a station file.")] = None,
    position: Annotated[
        list[str] | None,
        typer.Option(metavar='"A1 ... A7"', help="Degrees; with several robots NAME=A1 ... A7, once for each."),
    ] = None,
    live: Annotated[bool, typer.Option("--live", help="As the running controllers of the station say.")] = False,
    controller: Annotated[
        str | None, typer.Option(metavar="HOST[:PORT]", help="As this running controller says; it only looks.")
    ] = None,
    view: Annotated[
        str, typer.Option(help="From where: corner, front, left, back, right, top, or AZIMUTH/ELEVATION in degrees.")
    ] = "corner",
    size: Annotated[str, typer.Option(metavar="WxH", help="Pixels.")] = "1000x1000",
    transparent: Annotated[bool, typer.Option("--transparent", help="No background instead of a white one.")] = False,
) -> None:
    """Draw robots into a PNG file, without a screen: in their initial position, in one of yours, or as they are now."""
    from tools.snapshot.camera import parse_view
    from tools.snapshot.opengl import choose

    choose(os.environ)
    width, height = _size(size)
    side = parse_view(view)
    _check_folder(out)
    if station is not None and robot is not None:
        raise ConfigurationError("--robot is for a picture without a station file; the station has its robots")
    if controller is not None and station is not None:
        raise ConfigurationError("--controller is for a picture without a station file; --live asks all of a station")

    from matplotlib import image

    from tools.snapshot.camera import camera_for
    from tools.snapshot.drawing import draw
    from tools.snapshot.world import PictureWorld, parse_position

    positions: dict[str, Seven] = {}
    if controller is not None or (live and station is None):
        shown, positions = _seen_alone(controller, robot)
    else:
        shown = Station(robot=[RobotConfig() if robot is None else RobotConfig(model=robot)])
        if station is not None:
            shown = load_station(station)
        if live:
            positions = _seen(shown)
    surroundings = shown.surroundings()
    for text in position or ():
        name, wanted = parse_position(text, surroundings.arms)
        positions[name] = wanted
    world = PictureWorld(surroundings, positions)
    picture = draw(world, camera_for(world.points_m(), side, width, height), transparent=transparent)
    try:
        image.imsave(out, picture, format="png")
    except OSError as error:
        raise ConfigurationError(f"cannot write the picture {out}: {error.strerror}") from error
    typer.echo(
        f"{out}: {width} x {height} pixels, {', '.join(_title(arm.name, arm.model) for arm in surroundings.arms)}"
    )


def _title(name: str, model: str) -> str:
    return model if name == model else f"{name} ({model})"


def _size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"([0-9]{1,6})x([0-9]{1,6})", text, re.ASCII)
    if found is None:
        raise ConfigurationError(f"the size {text!r} is not WIDTHxHEIGHT in pixels, such as 1000x800")
    width, height = int(found[1]), int(found[2])
    if not (_LEAST_PIXELS <= width <= _MOST_PIXELS and _LEAST_PIXELS <= height <= _MOST_PIXELS):
        raise ConfigurationError(f"the size {text!r} is outside {_LEAST_PIXELS} ... {_MOST_PIXELS} pixels each way")
    return width, height


def _check_folder(out: Path) -> None:
    """Refuse what cannot be written before anything is drawn, or anybody asked."""
    if out.suffix.lower() != ".png":
        raise ConfigurationError(f"the picture is a PNG file, and {str(out)!r} does not end in .png")
    if out.is_dir():
        raise ConfigurationError(f"cannot write the picture {out}: that is a folder")
    if not out.parent.is_dir():
        raise ConfigurationError(f"cannot write the picture {out}: there is no folder {out.parent}")


def _seen_alone(controller: str | None, model: str | None) -> "tuple[Station, dict[str, Seven]]":
    """Ask one controller, and draw the robot it has."""
    from hil.client.servo import SERVO_PORT
    from tools.snapshot.live import look_at

    address = f"{_THIS_MACHINE}:{SERVO_PORT}" if controller is None else controller
    seen = look_at(address)
    if model is not None and model != seen.model:
        raise ConfigurationError(f"the controller at {address} has a {seen.model}, and not a {model}")
    only = RobotConfig(model=seen.model)
    return Station(robot=[only]), {only.name: seen.position_rad}


def _seen(station: Station) -> "dict[str, Seven]":
    """Ask the controllers of a station, one after the other."""
    from tools.snapshot.live import look_at

    positions = {}
    for one in station.robot:
        if one.servo is None:
            raise ConfigurationError(
                f"{one.name} has no [robot.servo], so nobody can ask where it is; leave out --live"
            )
        host, port = _address(one.name, one.servo)
        seen = look_at(f"{host}:{port}", key_file=one.servo.key_file)
        if seen.model != one.model:
            raise ConfigurationError(
                f"the controller at {host}:{port} has a {seen.model}, and {one.name} is a {one.model}"
            )
        positions[one.name] = seen.position_rad
    return positions


def _address(robot: str, servo: ServoConfig) -> Address:
    """Return where a robot's controller is met from this machine."""
    from hil.client.servo import SERVO_PORT
    from transport.udp import parse_address

    bind = parse_address(servo.bind, default_port=SERVO_PORT)
    if bind.port == 0:
        raise ConfigurationError(f"the servo link of {robot} takes any free port: give --controller HOST:PORT")
    return Address(_THIS_MACHINE, bind.port) if bind.host == _ANY_ADDRESS else bind
