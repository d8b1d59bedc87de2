"""``hil doctor udp``: round trip, jitter and loss to a running controller."""

from pathlib import Path
from typing import Annotated

import typer

from hil.cli.doctor.output import JsonFile, Output
from hil.cli.doctor.waiting import waiting
from hil.values.errors import ConfigurationError
from hil.values.fri import CLIENT_PORT, Release
from hil.values.servo import MAX_STATE_PERIOD_MS, SERVO_PORT


def udp(  # noqa: PLR0917  # typer makes the options of the parameters
    controller: Annotated[str, typer.Argument(metavar="HOST[:PORT]", help="Where it serves applications.")],
    seconds: Annotated[float, typer.Option(min=0.2, max=120.0, help="Length of the measurement.")] = 5.0,
    period_ms: Annotated[
        int | None,
        typer.Option("--period-ms", min=1, max=MAX_STATE_PERIOD_MS, help="How often states come; 5, else 4."),
    ] = None,
    servo_key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Pre-shared key of the servo link; see: hil config key")
    ] = None,
    fri: Annotated[
        str | None,
        typer.Option(
            metavar="[ADDR:]PORT",
            help="Stand where the FRI client will stand, as 30200, and answer what HOST sends without commanding.",
        ),
    ] = None,
    fri_version: Annotated[
        Release | None, typer.Option(help="Release of the FRI session, with --fri; 1.15 is the default.")
    ] = None,
    json_file: JsonFile = None,
) -> None:
    """Round trip, jitter and loss to a running controller, as an observer of its servo link, who changes nothing.

    With --fri it is the FRI client instead, of a Cabinet too: the robot application must open its session to this host.
    """
    from tools.doctor.udp import diagnose_udp
    from tools.doctor.udp.fri import diagnose_fri
    from transport.servo import ServoCodec, load_key
    from transport.udp import ANY_HOST, parse_address

    output = Output(json_file)
    address = parse_address(controller, default_port=SERVO_PORT)
    if fri is not None:
        if servo_key is not None or period_ms is not None:
            raise ConfigurationError("--servo-key and --period-ms are of the servo link, --fri measures the FRI link")
        bind = parse_address(fri if ":" in fri else f"{ANY_HOST}:{fri}", default_port=CLIENT_PORT)
        with waiting(f"answering {address.host}", seconds) as progress:
            diagnosis = diagnose_fri(
                address, bind=bind, release=fri_version or Release.V1_15, seconds=seconds, progress=progress
            )
        output.tell(diagnosis)
        return
    if fri_version is not None:
        raise ConfigurationError("--fri-version is of the FRI link: give --fri PORT too")
    if address.port == 0:
        raise ConfigurationError(f"{controller!r}: a controller has a port of its own, 1..65535")
    codec = ServoCodec(None if servo_key is None else load_key(servo_key))
    with waiting(f"measuring against {address}", seconds) as progress:
        diagnosis = diagnose_udp(
            address, codec, seconds=seconds, period_ms=period_ms, has_key=servo_key is not None, progress=progress
        )
    output.tell(diagnosis)
