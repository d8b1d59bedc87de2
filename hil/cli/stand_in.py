"""``hil stand-in``: one side of a recorded conversation against the living other one."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.values.errors import UsageError
from hil.values.fri import CLIENT_PORT, Release

if TYPE_CHECKING:
    from hil.replay.result import ReplayResult

app = typer.Typer(
    help="One side of a recorded conversation against the living other one: client, application or controller.",
    no_args_is_help=True,
)

Capture = Annotated[Path, typer.Argument(metavar="FILE", help="Capture of the conversation.")]
FriVersion = Annotated[
    Release | None, typer.Option(help="Release of the recorded FRI library, where it cannot be told.")
]
Json = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write what was found.")]


@app.command()
def client(
    file: Capture,
    bind: Annotated[
        str, typer.Option(metavar="ADDR[:PORT]", help="Where the live controller's messages come.")
    ] = f"127.0.0.1:{CLIENT_PORT}",
    fri_version: FriVersion = None,
    duration: Annotated[float | None, typer.Option(metavar="S", min=0.0, help="End after so many seconds.")] = None,
    json_file: Json = None,
) -> None:
    """Answer a live controller as the recorded FRI client did, state by state."""
    from hil.replay.live import client_against_controller
    from hil.replay.replay import Wish
    from hil.runtime.lifetime import check_result_file, write_result_file
    from transport.udp import parse_address

    check_result_file(json_file)
    address = parse_address(bind, default_port=CLIENT_PORT)
    played = client_against_controller(file, Wish(fri_version), bind=address, duration_s=duration)
    states = " -> ".join(state.name for state in played.states)
    typer.echo(
        f"{played.received} messages of the live controller, {played.answered} answered as recorded "
        f"({played.repeated} of them again, where its state lasted longer); {states}"
    )
    told = {
        "received": played.received,
        "answered": played.answered,
        "repeated": played.repeated,
        "malformed": played.malformed,
        "states": [state.name for state in played.states],
    }
    write_result_file(json_file, told)


@app.command()
def application(
    file: Capture,
    controller: Annotated[
        str, typer.Option(metavar="HOST[:PORT]", help="Servo link of the live controller.")
    ] = "127.0.0.1:30300",
    servo_key: Annotated[Path | None, typer.Option(metavar="FILE", help="Pre-shared key of the servo link.")] = None,
    json_file: Json = None,
) -> None:
    """Speak to a live controller as the recorded application did: the same requests at the same times."""
    from hil.replay.live import application_against_controller, controller_address
    from hil.runtime.lifetime import check_result_file, write_result_file
    from transport.servo import ServoCodec, load_key

    check_result_file(json_file)
    codec = ServoCodec(None if servo_key is None else load_key(servo_key))
    played = application_against_controller(file, controller=controller_address(controller), codec=codec)
    typer.echo(f"{played.sent} packets sent as recorded, {played.states} states came from the live controller")
    told = {
        "sent": played.sent,
        "received": played.received,
        "states": played.states,
        "malformed": played.malformed,
        "ended_because": played.ended_because,
    }
    write_result_file(json_file, told)
    if played.ended_because:
        typer.echo(played.ended_because, err=True)
        raise typer.Exit(1)


@app.command()
def controller(
    file: Capture,
    client: Annotated[
        str, typer.Option(metavar="HOST[:PORT]", help="Where the live FRI client listens.")
    ] = f"127.0.0.1:{CLIENT_PORT}",
    bind: Annotated[str | None, typer.Option(metavar="ADDR[:PORT]", help="Where to speak from.")] = None,
    fri_version: FriVersion = None,
    json_file: Json = None,
) -> None:
    """Speak to a live FRI client as the recorded controller did, and compare its answers with the recorded ones.

    Exit code 0: every answer is the recorded one; 1: not.
    """
    from hil.replay.live import controller_against_client
    from hil.replay.replay import Wish
    from hil.runtime.lifetime import check_result_file
    from transport.udp import default_bind, parse_address, refuse_shared_port

    check_result_file(json_file)
    peer = parse_address(client, default_port=CLIENT_PORT)
    own = default_bind(peer) if bind is None else parse_address(bind, default_port=0)
    refuse_shared_port(bind=own, peer=peer)
    played, result = controller_against_client(file, Wish(fri_version), client=peer, bind=own)
    if not result.inputs:
        raise UsageError(f"no answer came from {peer}: does an FRI client listen there?")
    _end(played.sent, "messages", "answers", result, json_file)


@app.command()
def servo_controller(
    file: Capture,
    bind: Annotated[
        str, typer.Option(metavar="ADDR[:PORT]", help="Where the live application connects to.")
    ] = "127.0.0.1:30300",
    servo_key: Annotated[Path | None, typer.Option(metavar="FILE", help="Pre-shared key of the servo link.")] = None,
    json_file: Json = None,
) -> None:
    """Speak to a live application as the recorded controller did, and compare its requests with the recorded ones.

    Exit code 0: every request is the recorded one; 1: not.
    """
    from hil.replay.live import controller_address, controller_against_application
    from hil.runtime.lifetime import check_result_file
    from transport.servo import ServoCodec, load_key

    check_result_file(json_file)
    codec = ServoCodec(None if servo_key is None else load_key(servo_key))
    played, result = controller_against_application(file, bind=controller_address(bind), codec=codec)
    _end(played.sent, "packets", "requests", result, json_file)


def _end(sent: int, what: str, live: str, result: "ReplayResult", json_file: Path | None) -> None:
    """Say how the ``live`` ones compare with the recorded ones, and end with the exit code."""
    from hil.runtime.lifetime import write_result_file

    told = f"{sent} {what} sent as recorded; "
    if result.equal:
        told += f"all {result.identical} {live} are those recorded"
    else:
        whole = result.compared + result.extra + result.missing
        told += f"{result.identical} of {whole} {live} are those recorded; the first that is not: {result.first}"
    typer.echo(told)
    write_result_file(json_file, {"sent": sent, **result.as_dict()})
    if not result.equal:
        raise typer.Exit(1)
