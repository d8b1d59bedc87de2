"""``hil doctor udp``: round trip, jitter and loss to a running controller."""

from pathlib import Path
from typing import Annotated

import typer

from hil.cli.doctor.output import JsonFile, Output
from hil.cli.doctor.waiting import waiting
from hil.values.errors import ConfigurationError
from hil.values.servo import MAX_STATE_PERIOD_MS, SERVO_PORT


def udp(
    controller: Annotated[str, typer.Argument(metavar="HOST[:PORT]", help="Where it serves applications.")],
    seconds: Annotated[float, typer.Option(min=0.2, max=120.0, help="Length of the measurement.")] = 5.0,
    period_ms: Annotated[
        int | None,
        typer.Option("--period-ms", min=1, max=MAX_STATE_PERIOD_MS, help="How often states come; 5, else 4."),
    ] = None,
    servo_key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Pre-shared key of the servo link; see: hil config key")
    ] = None,
    json_file: JsonFile = None,
) -> None:
    """Round trip, jitter and loss to a running controller, as an observer of its servo link, who changes nothing."""
    from tools.doctor.udp import diagnose_udp
    from transport.servo import ServoCodec, load_key
    from transport.udp import parse_address

    output = Output(json_file)
    address = parse_address(controller, default_port=SERVO_PORT)
    if address.port == 0:
        raise ConfigurationError(f"{controller!r}: a controller has a port of its own, 1..65535")
    codec = ServoCodec(None if servo_key is None else load_key(servo_key))
    with waiting(f"measuring against {address}", seconds) as progress:
        diagnosis = diagnose_udp(
            address, codec, seconds=seconds, period_ms=period_ms, has_key=servo_key is not None, progress=progress
        )
    output.tell(diagnosis)
