"""An FRI client that lays a sine of torque over axes under joint impedance: ``python -m apps.fri_torque_sine``.

It computes what the vendor's torque sine example computes, operation for operation, so its answers are the same bytes.
The controller must run a torque overlay: ``hil run --overlay torque --send-period 5``.
"""

from collections.abc import Callable
from typing import Annotated

import typer

from apps._fri_client import Bind, FriVersion, Host, JsonFile, Port, Seconds, speaker
from apps._fri_sample import Plot, SampleHandler, Sine, run_sample
from hil.client.fri import ANY_HOST, CLIENT_PORT, ClientCommandMode, Command, FriState, Release


class TorqueSine(SampleHandler):
    """Adds a sine of torque to ``joints`` (1-based), amplitude in Nm; the positions are mirrored."""

    def __init__(
        self,
        *,
        joints: tuple[int, ...] = (4,),
        amplitude_nm: float = 15.0,
        frequency_hz: float = 0.25,
        say: Callable[[str], None] | None = None,
    ) -> None:
        super().__init__(ClientCommandMode.TORQUE, laid="added torque, Nm", say=say)
        self._sine = Sine(amplitude_nm, frequency_hz)
        self._driven = frozenset(joint - 1 for joint in joints)

    def begin(self) -> None:
        """Begin a new motion from rest."""
        self._sine.begin()

    def command(self, state: FriState) -> Command | None:
        """Return the sine as torques; what is left out is mirrored."""
        if not self.commands(state):
            return None
        torque_nm = self._sine.next(state.sample_time_s)
        self.note(state, torque_nm)
        return Command(torque_nm=tuple(torque_nm if joint in self._driven else 0.0 for joint in range(7)))


def main(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    joint: Annotated[list[int] | None, typer.Option(min=1, max=7, help="Axis to drive, 1..7; may repeat. 4.")] = None,
    amplitude: Annotated[float, typer.Option(metavar="NM", help="Amplitude of the sine.")] = 15.0,
    frequency: Annotated[float, typer.Option(metavar="HZ", help="Frequency of the sine.")] = 0.25,
    fri_version: FriVersion = Release.V1_15,
    port: Port = CLIENT_PORT,
    bind: Bind = ANY_HOST,
    host: Host = None,
    seconds: Seconds = None,
    json_file: JsonFile = None,
    plot: Plot = None,
) -> None:
    """Lay a sine of torque over axes while the controller lets us command. Ctrl-C ends it with the summary.

    Exit code 1 when no controller was heard, 2 for arguments or a port that cannot be used.
    """
    handler = TorqueSine(
        joints=tuple(joint or (4,)), amplitude_nm=amplitude, frequency_hz=frequency, say=speaker(json_file)
    )
    run_sample(
        "fri_torque_sine",
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
