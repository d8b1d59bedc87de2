"""An FRI client (2.x) that moves the flange along a sine, and its elbow too: ``python -m apps.fri_cartesian_sine``.

The controller must run a Cartesian pose overlay:
``hil run --overlay cartesian-pose --fri-version 2.7 --send-period 5``.
"""

from collections.abc import Callable
from enum import StrEnum
from typing import Annotated

import typer

from apps._fri_client import Bind, FriVersion, Host, JsonFile, Port, Seconds, speaker
from apps._fri_sample import FadingSine, Plot, SampleHandler, run_sample
from hil.client.fri import ANY_HOST, CLIENT_PORT, ClientCommandMode, Command, FriState, Release


class Along(StrEnum):
    """An axis of the robot base."""

    X = "x"
    Y = "y"
    Z = "z"


class CartesianPoseSine(SampleHandler):
    """Adds a filtered sine to one coordinate of the interpolator pose, in mm, and one to E1, in rad."""

    def __init__(
        self,
        *,
        along: Along = Along.Y,
        amplitude_mm: float = 20.0,
        e1_amplitude_rad: float = 0.0,
        frequency_hz: float = 0.25,
        say: Callable[[str], None] | None = None,
    ) -> None:
        super().__init__(ClientCommandMode.CARTESIAN_POSE, laid=f"offset along {along}, mm", say=say)
        self._place = list(Along).index(along)
        self._sine = FadingSine(amplitude_mm, frequency_hz)
        self._elbow = FadingSine(e1_amplitude_rad, frequency_hz) if e1_amplitude_rad else None

    def begin(self) -> None:
        """Begin a new motion from rest."""
        self._sine.begin()
        if self._elbow is not None:
            self._elbow.begin()

    def command(self, state: FriState) -> Command | None:
        """Return the interpolator pose with the sine laid over it; without a sine of its own, E1 is left out."""
        if not self.commands(state):
            return None
        offset_mm = self._sine.next(state.sample_time_s)
        self.note(state, offset_mm)
        pose = list(state.interpolator_pose)
        pose[self._place] += offset_mm
        if self._elbow is None:
            return Command(pose=tuple(pose))
        offset_rad = self._elbow.next(state.sample_time_s)
        return Command(pose=tuple(pose), e1_rad=state.interpolator_redundancy.value + offset_rad)


def main(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    along: Annotated[Along, typer.Option(help="Axis of the robot base.")] = Along.Y,
    amplitude: Annotated[float, typer.Option(metavar="MM", help="Amplitude of the sine.")] = 20.0,
    e1_amplitude: Annotated[float, typer.Option(metavar="RAD", help="Amplitude of E1, the elbow.")] = 0.0,
    frequency: Annotated[float, typer.Option(metavar="HZ", help="Frequency of both.")] = 0.25,
    fri_version: FriVersion = Release.V2_7,
    port: Port = CLIENT_PORT,
    bind: Bind = ANY_HOST,
    host: Host = None,
    seconds: Seconds = None,
    json_file: JsonFile = None,
    plot: Plot = None,
) -> None:
    """Move the flange along a sine while the controller lets us command. Ctrl-C ends it with the summary.

    Exit code 1 when no controller was heard, 2 for arguments or a port that cannot be used.
    """
    if fri_version not in {Release.V2_5, Release.V2_7}:
        typer.echo(f"fri_cartesian_sine: release {fri_version.value} has no poses; 2.5 and 2.7 have", err=True)
        raise typer.Exit(2)
    handler = CartesianPoseSine(
        along=along,
        amplitude_mm=amplitude,
        e1_amplitude_rad=e1_amplitude,
        frequency_hz=frequency,
        say=speaker(json_file),
    )
    run_sample(
        "fri_cartesian_sine",
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
