"""An FRI client that provides the transformations it is asked for: ``python -m apps.fri_transformation_provider``.

Each moves along x, y and z in steps of 1, 5 and 10 mm a message, over and over, without a rotation: what the recorded
clients send, byte for byte. The station file of the controller names them (README, "Inputs, outputs and
transformations"). The arm is left where it is.
"""

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from apps._fri_client import (
    Bind,
    FriVersion,
    Host,
    JsonFile,
    Panel,
    Port,
    SampleTimes,
    Seconds,
    Series,
    run_client,
    session_figures,
    speaker,
    write_json,
    write_plot,
)
from hil.client.fri import (
    ANY_HOST,
    CLIENT_PORT,
    Command,
    FriClient,
    FriHandler,
    FriState,
    Release,
    SessionState,
    make_transformation,
)

START_MM: Final = (10.0, 10.0, 10.0)
STEP_MM: Final = (1.0, 5.0, 10.0)
END_MM: Final = (100.0, 200.0, 300.0)
"""Past it an axis begins at 0 again."""


class Provider(FriHandler):
    """Provides whatever is asked for, with the time stamp of the message it answers. Tells state changes to ``say``."""

    def __init__(self, *, say: Callable[[str], None] | None = None) -> None:
        self.states: Counter[str] = Counter()
        """Monitoring messages by session state."""
        self.requested: tuple[str, ...] = ()
        """Names the controller asked for last."""
        self.position_mm = START_MM
        self.times = SampleTimes()
        self.path_mm: list[tuple[float, float, float]] = []
        self._say = say

    def on_state_change(self, old: SessionState, new: SessionState) -> None:
        """Say what happened."""
        if self._say is not None:
            self._say(f"{old.name} -> {new.name}, quality {self.robot_state.quality.name}")

    def monitor(self, state: FriState) -> Command:
        """Provide."""
        return self._provide(state)

    def wait_for_command(self, state: FriState) -> Command:
        """Provide, and mirror."""
        return self._provide(state)

    def command(self, state: FriState) -> Command:
        """Provide, and mirror."""
        return self._provide(state)

    def _provide(self, state: FriState) -> Command:
        self.states[state.session_state.name] += 1
        x, y, z = (
            value + step if value + step <= end else 0.0
            for value, step, end in zip(self.position_mm, STEP_MM, END_MM, strict=True)
        )
        self.position_mm = (x, y, z)
        if self.times.add(state):
            self.path_mm.append(self.position_mm)
        requested = tuple(transformation.name for transformation in state.requested_transformations)
        if requested != self.requested:
            self.requested = requested
            if self._say is not None:
                self._say(f"asked for {', '.join(requested) or 'no transformation'}")
        return Command(transformations=tuple(make_transformation(state, name, (x, y, z)) for name in requested))


def main(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    fri_version: FriVersion = Release.V1_15,
    port: Port = CLIENT_PORT,
    bind: Bind = ANY_HOST,
    host: Host = None,
    seconds: Seconds = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw what was provided over time.")] = None,
    json_file: JsonFile = None,
) -> None:
    """Provide the transformations the controller asks for. Ctrl-C ends it with the summary.

    Exit code 1 when no controller was heard or none was asked for, 2 for arguments or a port that cannot be used.
    """
    say = speaker(json_file)
    handler = Provider(say=say)
    client = FriClient(handler, release=fri_version, port=port, bind_host=bind, controller=host)
    run_client("fri_transformation_provider", client, seconds=seconds, say=say)
    result = {
        **session_figures(client),
        "states": dict(handler.states),
        "requested": list(handler.requested),
        "last_position_mm": list(handler.position_mm),
    }
    say(_summary(result))
    if plot is not None:
        axes = [Series(axis, [point[index] for point in handler.path_mm]) for index, axis in enumerate("xyz")]
        title = f"Transformations over FRI: {', '.join(handler.requested) or 'none was asked for'}"
        write_plot("fri_transformation_provider", plot, title, handler.times.at_s, (Panel("mm", axes, steps=True),))
        say(f"wrote {plot}")
    if json_file is not None:
        write_json("fri_transformation_provider", json_file, result)
    raise typer.Exit(0 if result["received"] and handler.requested else 1)


def _summary(result: dict[str, Any]) -> str:
    if not result["received"]:
        return "no controller was heard"
    if not result["requested"]:
        return f"{result['received']} messages received; the controller asks for no transformation"
    x, y, z = result["last_position_mm"]
    return (
        f"{result['received']} messages received, {result['answers']} answered; "
        f"{', '.join(result['requested'])} at {x:g}, {y:g}, {z:g} mm last"
    )


if __name__ == "__main__":
    typer.run(main)
