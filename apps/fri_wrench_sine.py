"""An FRI client that lays sines of force over Cartesian impedance: ``python -m apps.fri_wrench_sine``.

It computes what the vendor's wrench sine example computes, operation for operation, so its answers are the same bytes.
The controller must run a wrench overlay: ``hil run --overlay wrench --send-period 5``.
"""

from collections.abc import Callable
from typing import Annotated

import typer

from apps._fri_client import Bind, FriVersion, Host, JsonFile, Port, Seconds, speaker
from apps._fri_sample import Plot, SampleHandler, Sine, run_sample
from hil.client.fri import ANY_HOST, CLIENT_PORT, ClientCommandMode, Command, FriState, Release


class WrenchSine(SampleHandler):
    """Pushes the flange along its x and y with a sine each, amplitudes in N; the positions are mirrored."""

    def __init__(
        self,
        *,
        amplitude_x_n: float = 5.0,
        amplitude_y_n: float = 5.0,
        frequency_hz: float = 0.25,
        say: Callable[[str], None] | None = None,
    ) -> None:
        super().__init__(ClientCommandMode.WRENCH, laid="force along x, N", say=say)
        self._along_x = Sine(amplitude_x_n, frequency_hz)
        self._along_y = Sine(amplitude_y_n, frequency_hz)

    def begin(self) -> None:
        """Begin a new motion from rest."""
        self._along_x.begin()
        self._along_y.begin()

    def command(self, state: FriState) -> Command | None:
        """Return the sines as a wrench; what is left out is mirrored."""
        if not self.commands(state):
            return None
        x_n, y_n = self._along_x.next(state.sample_time_s), self._along_y.next(state.sample_time_s)
        self.note(state, x_n)
        return Command(wrench=(x_n, y_n, 0.0, 0.0, 0.0, 0.0))


def main(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    amplitude_x: Annotated[float, typer.Option(metavar="N", help="Amplitude of the force along x.")] = 5.0,
    amplitude_y: Annotated[float, typer.Option(metavar="N", help="Amplitude of the force along y.")] = 5.0,
    frequency: Annotated[float, typer.Option(metavar="HZ", help="Frequency of both.")] = 0.25,
    fri_version: FriVersion = Release.V1_15,
    port: Port = CLIENT_PORT,
    bind: Bind = ANY_HOST,
    host: Host = None,
    seconds: Seconds = None,
    json_file: JsonFile = None,
    plot: Plot = None,
) -> None:
    """Push the flange with sines of force while the controller lets us command. Ctrl-C ends it with the summary.

    Exit code 1 when no controller was heard, 2 for arguments or a port that cannot be used.
    """
    handler = WrenchSine(
        amplitude_x_n=amplitude_x, amplitude_y_n=amplitude_y, frequency_hz=frequency, say=speaker(json_file)
    )
    run_sample(
        "fri_wrench_sine",
        handler,
        release=fri_version,
        port=port,
        bind=bind,
        host=host,
        seconds=seconds,
        json_file=json_file,
        plot=plot,
    )


if __name__ == "__main__":
    typer.run(main)
