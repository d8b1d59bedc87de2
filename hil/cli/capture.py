"""``hil capture``: record a controller that runs already."""

import contextlib
import os
import socket
import subprocess
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from hil.client.pad import CaptureInfo, PadClient, PadRefused
from hil.values.errors import EndpointError
from transport.capture.process import create_file, start_writer

app = typer.Typer(help="Record a running controller: all packets, and what a replay needs.", no_args_is_help=True)

Socket = Annotated[
    Path | None, typer.Option("--socket", metavar="PATH", help="Socket of the controller; your only one is found.")
]
_LOOKS = 500
"""How often it is asked whether the file is complete; the controller answers each question after some milliseconds."""


@app.command()
def start(
    file: Annotated[Path, typer.Argument(metavar="FILE.pcapng", help="File to write.")],
    ring: Annotated[
        str | None, typer.Option("--ring", metavar="FILESxSIZE", help="Keep only the newest files, such as 10x100MB.")
    ] = None,
    socket_path: Socket = None,
) -> None:
    """Record from now on. A recording that did not begin with the run is compared, not replayed to the byte."""
    with PadClient(socket_path) as pad, tempfile.TemporaryDirectory(prefix="hil-capture-") as folder:
        place = Path(folder) / "writer.sock"
        is_new = not file.exists()
        writer = _start_writer(file, place)
        try:
            told = pad.start_capture(place, file.absolute(), ring)
        except PadRefused:
            # It would wait for a while for somebody to connect, and nobody else could have the file meanwhile.
            writer.kill()
            writer.wait()
            if is_new:
                file.unlink(missing_ok=True)
            raise
        finally:
            # It lives on without us, which is no error of ours at the end of this process.
            writer.returncode = 0
    typer.echo(f"recording to {told['path']}; hil capture stop ends it, and so does the end of the run")


@app.command()
def stop(socket_path: Socket = None) -> None:
    """End the recording, and say what is in the file."""
    with PadClient(socket_path) as pad:
        told: CaptureInfo | None = pad.stop_capture()
        for _ in range(_LOOKS):
            told = pad.capture()
            if told is None or told["state"] == "complete":
                break
    if told is None or "written" not in told:
        raise EndpointError("the file is not complete yet: its writer does not keep up; hil capture status asks again")
    _show(told)


@app.command()
def status(socket_path: Socket = None) -> None:
    """Say whether the controller records."""
    with PadClient(socket_path) as pad:
        told = pad.capture()
    if told is None:
        typer.echo("nothing was recorded")
    else:
        _show(told)


def _start_writer(file: Path, place: Path) -> subprocess.Popen[bytes]:
    """Start the process that writes: nothing may be started in the controller, whose cycles it would cost."""
    file_fd = create_file(file, keep=True)
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
            listener.bind(str(place))
            listener.listen(1)
            return start_writer(file, socket_fd=listener.fileno(), file_fd=file_fd, listens=True, detached=True)
    finally:
        with contextlib.suppress(OSError):
            os.close(file_fd)


def _show(told: CaptureInfo) -> None:
    text = f"{told['path']}: {told['state']}, {told['dropped']} packets dropped"
    if "written" in told:
        text += f", {told['written']} written"
        if told.get("removed"):
            text += f", {told['removed']} in files the ring removed"
    typer.echo(text)
    if error := told.get("error"):
        typer.echo(error, err=True)
        raise typer.Exit(1)
