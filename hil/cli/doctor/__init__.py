"""``hil doctor``: whose fault it was, in one sentence, with the evidence below it."""

import typer

from hil.cli.doctor import capture, host, kst, tcp, udp

app = typer.Typer(
    help="Whose fault was it: one sentence, and the evidence below it. Exit code 0: nothing found, 1: something is "
    "wrong, 2: it could not be looked at.",
    no_args_is_help=True,
)


@app.callback()
def doctor() -> None:
    """Whose fault was it: one sentence, and the evidence below it."""


app.command("capture")(capture.capture)
app.command("host")(host.host)
app.command("kst")(kst.kst)
app.command("tcp")(tcp.tcp)
app.command("udp")(udp.udp)
