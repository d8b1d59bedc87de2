"""An FRI client that lays a sine over axes of the arm: ``python -m apps.fri_joint_sine``.

It computes what the vendor's joint sine example computes, operation for operation, so its answers are the same bytes.
"""

import json
import math
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from hil.client.fri import (
    ANY_HOST,
    CLIENT_PORT,
    Command,
    FriClient,
    FriHandler,
    FriState,
    HilError,
    NothingHeard,
    Release,
    SessionState,
    Vector,
)

FILTER: Final = 0.99
"""Share of the old offset in the new one: lets the sine fade in."""


class JointSine(FriHandler):
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
        self.amplitude_rad = amplitude_rad
        self.frequency_hz = frequency_hz
        self.states: Counter[str] = Counter()
        """Monitoring messages by session state; of IDLE, only the one that closed a session."""
        self.first_position_rad: Vector | None = None
        self.last_position_rad: Vector | None = None
        self.peak_excursion_rad = [0.0] * 7
        """Largest distance of each measured axis from its first position, in rad."""
        self._say = say
        self._moved = frozenset(joint - 1 for joint in joints)
        self._offset_rad = 0.0
        self._phase_rad = 0.0

    def on_state_change(self, old: SessionState, new: SessionState) -> None:
        """Begin a new motion from rest, and say what happened."""
        if new is SessionState.MONITORING_READY:
            self._offset_rad = self._phase_rad = 0.0
        if new is SessionState.IDLE:
            self.states[new.name] += 1
        if self._say is not None:
            self._say(f"{old.name} -> {new.name}, quality {self.robot_state.quality.name}")

    def monitor(self, state: FriState) -> None:
        """Watch only."""
        self._watch(state)

    def wait_for_command(self, state: FriState) -> None:
        """Watch, and mirror."""
        self._watch(state)

    def command(self, state: FriState) -> Command:
        """Return the interpolator position with the sine laid over it."""
        self._watch(state)
        swing_rad = self.amplitude_rad * math.sin(self._phase_rad)
        self._offset_rad = self._offset_rad * FILTER + swing_rad * (1.0 - FILTER)
        self._phase_rad += 2 * math.pi * self.frequency_hz * state.sample_time_s
        if self._phase_rad >= 2 * math.pi:
            self._phase_rad -= 2 * math.pi
        return Command(
            joint_position_rad=tuple(
                position + self._offset_rad if joint in self._moved else position
                for joint, position in enumerate(state.interpolator_position_rad)
            )
        )

    def _watch(self, state: FriState) -> None:
        self.states[state.session_state.name] += 1
        position = self.last_position_rad = state.measured_position_rad
        first = self.first_position_rad = self.first_position_rad or position
        self.peak_excursion_rad = [
            max(peak, abs(now - then)) for peak, now, then in zip(self.peak_excursion_rad, position, first, strict=True)
        ]


def main(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    joint: Annotated[list[int] | None, typer.Option(min=1, max=7, help="Axis to move, 1..7; may repeat. 4.")] = None,
    amplitude: Annotated[float, typer.Option(metavar="RAD", help="Amplitude of the sine.")] = 0.04,
    frequency: Annotated[float, typer.Option(metavar="HZ", help="Frequency of the sine.")] = 0.25,
    fri_version: Annotated[Release, typer.Option(help="Release the controller speaks.")] = Release.V1_15,
    port: Annotated[int, typer.Option(help="Own UDP port.")] = CLIENT_PORT,
    bind: Annotated[str, typer.Option(metavar="ADDR", help="Own address; 0.0.0.0 is all of them.")] = ANY_HOST,
    host: Annotated[
        str | None, typer.Option(metavar="HOST[:PORT]", help="Controller: hear no other. Default: whoever sends.")
    ] = None,
    seconds: Annotated[float | None, typer.Option(min=0.0, help="End after so many seconds.")] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE|-", help="Write the result; -: standard output.")
    ] = None,
) -> None:
    """Lay a sine over axes of the arm while the controller lets us command. Ctrl-C ends it with the summary.

    Exit code 1 when no controller was heard, 2 for arguments or a port that cannot be used.
    """
    # With the result on standard output, everything for the reader goes beside it.
    say = partial(typer.echo, err=json_file == Path("-"))
    handler = JointSine(joints=tuple(joint or (4,)), amplitude_rad=amplitude, frequency_hz=frequency, say=say)
    client = FriClient(handler, release=fri_version, port=port, bind_host=bind, controller=host)
    try:
        with client:
            say(f"FRI {fri_version.value} client on {client.local}")
            client.run(duration_s=seconds)
    except KeyboardInterrupt:
        say("interrupted")
    except NothingHeard as error:
        typer.echo(f"fri_joint_sine: {error}", err=True)
    except HilError as error:
        typer.echo(f"fri_joint_sine: {error}", err=True)
        raise typer.Exit(2) from None
    result = _result(client, handler)
    say(_summary(result))
    if json_file is not None:
        _write(json_file, result)
    raise typer.Exit(0 if result["received"] else 1)


def _result(client: FriClient, handler: JointSine) -> dict[str, Any]:
    session = client.session
    return {
        "release": session.release.value,
        "received": session.received,
        "answers": session.answered,
        "malformed": {outcome.value: count for outcome, count in session.malformed.items()},
        "states": dict(handler.states),
        "peak_excursion_rad": handler.peak_excursion_rad,
        "first_position": handler.first_position_rad,
        "last_position": handler.last_position_rad,
    }


def _summary(result: dict[str, Any]) -> str:
    if not result["received"]:
        return "no controller was heard"
    peaks = enumerate(result["peak_excursion_rad"], start=1)
    moved = ", ".join(f"A{axis} {peak:.4f} rad" for axis, peak in peaks if peak >= 5e-5)
    malformed = sum(result["malformed"].values())
    return (
        f"{result['received']} messages received, {result['answers']} answered, {malformed} malformed; "
        f"largest measured excursion: {moved or 'none'}"
    )


def _write(file: Path, result: dict[str, Any]) -> None:
    text = json.dumps(result)
    if file == Path("-"):
        typer.echo(text)
    else:
        try:
            file.write_text(f"{text}\n", encoding="utf-8")
        except OSError as error:
            typer.echo(f"fri_joint_sine: cannot write {file}: {error.strerror}", err=True)
            raise typer.Exit(2) from None


if __name__ == "__main__":
    typer.run(main)
