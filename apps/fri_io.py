"""An FRI client that reads an input and counts time on two outputs: ``python -m apps.fri_io``.

While the boolean input ``FRI.In_Bool_Clock_Enabled`` is on, it adds 0.1 to ``FRI.Out_Analog_Deci_Seconds`` every tenth
of a second, and one to ``FRI.Out_Integer_Seconds`` when that is a whole second: what the recorded clients of 2.5 and
2.7 do. As theirs, its answers hold nothing else, so it never commands the arm. The station file of the controller
defines the three (README, "Inputs, outputs and transformations").
"""

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from apps._fri_client import (
    Bind,
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
from hil.client.fri import ANY_HOST, CLIENT_PORT, Command, FriClient, FriHandler, FriState, Release, SessionState

CLOCK_ENABLED: Final = "FRI.In_Bool_Clock_Enabled"
DECI_SECONDS: Final = "FRI.Out_Analog_Deci_Seconds"
SECONDS: Final = "FRI.Out_Integer_Seconds"
_TICK_MS: Final = 100
_FULL: Final = 0.95
"""Nearer to 1 than to 0.9, however ten tenths were rounded."""


class Clock(FriHandler):
    """Counts on the two outputs from the values the controller lists. State changes are told to ``say``."""

    def __init__(self, *, say: Callable[[str], None] | None = None) -> None:
        self.states: Counter[str] = Counter()
        """Monitoring messages by session state."""
        self.ticks = 0
        self.times = SampleTimes()
        self.enabled: list[bool] = []
        self.deci_seconds: list[float] = []
        self.seconds: list[int] = []
        self._say = say
        self._elapsed_ms = 0

    def on_state_change(self, old: SessionState, new: SessionState) -> None:
        """Say what happened."""
        if self._say is not None:
            self._say(f"{old.name} -> {new.name}, quality {self.robot_state.quality.name}")

    def monitor(self, state: FriState) -> Command:
        """Count."""
        return self._count(state)

    def wait_for_command(self, state: FriState) -> Command:
        """Count: the recorded clients do it in every state."""
        return self._count(state)

    def command(self, state: FriState) -> Command:
        """Count."""
        return self._count(state)

    def _count(self, state: FriState) -> Command:
        enabled = state.boolean_io(CLOCK_ENABLED)
        deci_seconds, seconds = state.analog_io(DECI_SECONDS), state.digital_io(SECONDS)
        self.states[state.session_state.name] += 1
        if self.times.add(state):
            self.enabled.append(enabled)
            self.deci_seconds.append(deci_seconds)
            self.seconds.append(seconds)
        if not enabled:
            return Command(mirror=False)
        self._elapsed_ms += state.send_period_ms
        # What is returned for a message that gets no answer is lost.
        if self._elapsed_ms < _TICK_MS or self.states.total() % state.receive_multiplier:
            return Command(mirror=False)
        self._elapsed_ms = 0
        self.ticks += 1
        outputs: dict[str, float] = {DECI_SECONDS: deci_seconds + 0.1}
        if outputs[DECI_SECONDS] > _FULL:
            outputs = {DECI_SECONDS: 0.0, SECONDS: seconds + 1}
        return Command(outputs=outputs, mirror=False)


def main(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    fri_version: Annotated[Release, typer.Option(help="Release the controller speaks, 1.14 at least.")] = Release.V1_15,
    port: Port = CLIENT_PORT,
    bind: Bind = ANY_HOST,
    host: Host = None,
    seconds: Seconds = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw the values over time.")] = None,
    json_file: JsonFile = None,
) -> None:
    """Count time on two outputs while an input is on. Ctrl-C ends it with the summary.

    Exit code 1 when no controller was heard, 2 for arguments, a port or inputs and outputs that cannot be used.
    """
    say = speaker(json_file)
    handler = Clock(say=say)
    client = FriClient(handler, release=fri_version, port=port, bind_host=bind, controller=host)
    run_client("fri_io", client, seconds=seconds, say=say)
    result = {**session_figures(client), **_values(handler)}
    say(_summary(result))
    if plot is not None:
        panels = (
            Panel("input", (Series(CLOCK_ENABLED, handler.enabled),), steps=True),
            Panel("analog output", (Series(DECI_SECONDS, handler.deci_seconds),), steps=True),
            Panel("digital output", (Series(SECONDS, handler.seconds),), steps=True),
        )
        write_plot("fri_io", plot, "Inputs and outputs over FRI", handler.times.at_s, panels)
        say(f"wrote {plot}")
    if json_file is not None:
        write_json("fri_io", json_file, result)
    raise typer.Exit(0 if result["received"] else 1)


def _values(handler: Clock) -> dict[str, Any]:
    last: dict[str, Sequence[float]] = {
        CLOCK_ENABLED: handler.enabled[-1:],
        DECI_SECONDS: handler.deci_seconds[-1:],
        SECONDS: handler.seconds[-1:],
    }
    return {
        "states": dict(handler.states),
        "ticks": handler.ticks,
        "last": {name: values[0] for name, values in last.items() if values},
    }


def _summary(result: dict[str, Any]) -> str:
    if not result["received"]:
        return "no controller was heard"
    last = ", ".join(f"{name} {value:g}" for name, value in result["last"].items())
    return f"{result['received']} messages received, {result['answers']} answered, {result['ticks']} ticks; {last}"


if __name__ == "__main__":
    typer.run(main)
