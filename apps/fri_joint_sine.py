"""An FRI client that lays a sine over axes of the arm: ``python -m apps.fri_joint_sine``.

It computes what the vendor's joint sine example computes, operation for operation, so its answers are the same bytes.
"""

import math
from collections.abc import Callable
from typing import Annotated

import typer

from apps._fri_client import Bind, FriVersion, Host, JsonFile, Port, Seconds, speaker
from apps._fri_sample import FadingSine, Plot, SampleHandler, run_sample
from hil.client.fri import ANY_HOST, CLIENT_PORT, ClientCommandMode, Command, FriState, Release


class JointSine(SampleHandler):
    """Adds a filtered sine to the interpolator positions of ``joints``; amplitude in rad, frequency in Hz.

    ``joints`` are 1-based: 4 is A4. The phase advances with every monitoring message by its send period, which is one
    sample time for each answered message. State changes are told to ``say``, a line each.
    """

    def __init__(
        self,
        *,
        joints: tuple[int, ...] = (4,),
        amplitude_rad: float = 0.04,
        frequency_hz: float = 0.25,
        say: Callable[[str], None] | None = None,
    ) -> None:
        super().__init__(ClientCommandMode.JOINT_POSITION, laid="joint offset, degrees", say=say)
        self._sine = FadingSine(amplitude_rad, frequency_hz)
        self._moved = frozenset(joint - 1 for joint in joints)

    def begin(self) -> None:
        """Begin a new motion from rest."""
        self._sine.begin()

    def command(self, state: FriState) -> Command | None:
        """Return the interpolator position with the sine laid over it."""
        if not self.commands(state):
            return None
        offset_rad = self._sine.next(state.sample_time_s)
        self.note(state, math.degrees(offset_rad))
        return Command(
            joint_position_rad=tuple(
                position + offset_rad if joint in self._moved else position
                for joint, position in enumerate(state.interpolator_position_rad)
            )
        )


def main(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    joint: Annotated[list[int] | None, typer.Option(min=1, max=7, help="Axis to move, 1..7; may repeat. 4.")] = None,
    amplitude: Annotated[float, typer.Option(metavar="RAD", help="Amplitude of the sine.")] = 0.04,
    frequency: Annotated[float, typer.Option(metavar="HZ", help="Frequency of the sine.")] = 0.25,
    fri_version: FriVersion = Release.V1_15,
    port: Port = CLIENT_PORT,
    bind: Bind = ANY_HOST,
    host: Host = None,
    seconds: Seconds = None,
    json_file: JsonFile = None,
    plot: Plot = None,
) -> None:
    """Lay a sine over axes of the arm while the controller lets us command. Ctrl-C ends it with the summary.

    Exit code 1 when no controller was heard, 2 for arguments or a port that cannot be used.
    """
    handler = JointSine(
        joints=tuple(joint or (4,)), amplitude_rad=amplitude, frequency_hz=frequency, say=speaker(json_file)
    )
    run_sample(
        "fri_joint_sine",
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
