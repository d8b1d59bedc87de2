"""What the sines over FRI share: what they watch, what they print, and what they draw."""

import math
from collections import Counter, deque
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import typer

from apps._fri_client import Panel, Series, run_client, session_figures, speaker, write_json, write_plot
from hil.client.fri import (
    ANY_HOST,
    CLIENT_PORT,
    ClientCommandMode,
    FriClient,
    FriHandler,
    FriState,
    Release,
    SessionState,
    Vector,
)

FILTER: Final = 0.99
"""Share of the old offset in the new one."""
MOST_SAMPLES: Final = 200_000
"""Of a plot; the last ones are kept."""
JOINTS: Final = ("A1", "A2", "A3", "A4", "A5", "A6", "A7")
_POSES: Final = (Release.V2_5, Release.V2_7)
_OVERLAYS: Final = {
    ClientCommandMode.JOINT_POSITION: "joint-position",
    ClientCommandMode.TORQUE: "torque",
    ClientCommandMode.WRENCH: "wrench",
    ClientCommandMode.CARTESIAN_POSE: "cartesian-pose",
}

Plot = Annotated[Path | None, typer.Option(metavar="FILE.png", help="Draw what was laid over and what it did.")]


class Sine:
    """A sine that advances with each message by its send period."""

    def __init__(self, amplitude: float, frequency_hz: float) -> None:
        self.amplitude = amplitude
        self.frequency_hz = frequency_hz
        self._phase_rad = 0.0

    def begin(self) -> None:
        """Begin at 0 again."""
        self._phase_rad = 0.0

    def next(self, sample_time_s: float) -> float:
        """Return the value now, and go on by ``sample_time_s``."""
        value = self.amplitude * math.sin(self._phase_rad)
        self._phase_rad += 2 * math.pi * self.frequency_hz * sample_time_s
        if self._phase_rad >= 2 * math.pi:
            self._phase_rad -= 2 * math.pi
        return value


class FadingSine(Sine):
    """A sine whose share in the offset it gives grows with each message, so that it begins without a step."""

    def __init__(self, amplitude: float, frequency_hz: float) -> None:
        super().__init__(amplitude, frequency_hz)
        self._offset = 0.0

    def begin(self) -> None:
        """Begin at 0 again, with no offset."""
        super().begin()
        self._offset = 0.0

    def next(self, sample_time_s: float) -> float:
        """Return the offset now, and go on by ``sample_time_s``."""
        self._offset = self._offset * FILTER + super().next(sample_time_s) * (1.0 - FILTER)
        return self._offset


class Sample(NamedTuple):
    """One commanded cycle: when, what was laid over the interpolator, and where that has taken the arm."""

    at_s: float
    laid: float
    excursion: Vector
    """Of the flange along x, y, z in mm where the release has poses, else of the axes in degrees."""


class SampleHandler(FriHandler):
    """Counts states and measures how far the arm gets. State changes are told to ``say``, a line each.

    ``mode`` is what the sample commands: under another overlay it only mirrors, and says why. ``laid`` is what it lays
    over, with its unit, for the plot.
    """

    def __init__(self, mode: ClientCommandMode, *, laid: str, say: Callable[[str], None] | None = None) -> None:
        self.mode = mode
        self.laid = laid
        self.states: Counter[str] = Counter()
        """Monitoring messages by session state; of IDLE, only the one that closed a session."""
        self.first_position_rad: Vector | None = None
        self.last_position_rad: Vector | None = None
        self.peak_excursion_rad = [0.0] * 7
        """Largest distance of each measured axis from its first position, in rad."""
        self.first_pose: Vector | None = None
        self.peak_excursion_mm = [0.0] * 3
        """Largest distance of the measured flange from its first place along x, y, z of the base, in mm (2.x)."""
        self.samples: deque[Sample] | None = None
        """Set by whoever wants a plot."""
        self._say = say

    def begin(self) -> None:
        """Begin a new motion from rest."""

    def on_state_change(self, old: SessionState, new: SessionState) -> None:
        """Begin a new motion from rest, and say what happened."""
        state = self.robot_state
        if new is SessionState.MONITORING_READY:
            self.begin()
        if new is SessionState.IDLE:
            self.states[new.name] += 1
        if self._say is None:
            return
        self._say(f"{old.name} -> {new.name}, quality {state.quality.name}")
        if new is SessionState.COMMANDING_WAIT and state.client_command_mode is not self.mode:
            self._say(
                f"the running overlay takes {state.client_command_mode.name}, not {self.mode.name}: only mirroring; "
                f"start the controller with --overlay {_OVERLAYS[self.mode]}"
            )

    def monitor(self, state: FriState) -> None:
        """Watch only."""
        self.watch(state)

    def wait_for_command(self, state: FriState) -> None:
        """Watch, and mirror."""
        self.watch(state)

    def commands(self, state: FriState) -> bool:
        """Watch, and return whether the overlay is the one this sample commands."""
        self.watch(state)
        return state.client_command_mode is self.mode

    def watch(self, state: FriState) -> None:
        """Take note of where the arm is."""
        self.states[state.session_state.name] += 1
        position = self.last_position_rad = state.measured_position_rad
        first = self.first_position_rad = self.first_position_rad or position
        self.peak_excursion_rad = [
            max(peak, abs(now - then)) for peak, now, then in zip(self.peak_excursion_rad, position, first, strict=True)
        ]
        if state.release in _POSES:
            off_mm = self._off_mm(state)
            self.peak_excursion_mm = [
                max(peak, abs(off)) for peak, off in zip(self.peak_excursion_mm, off_mm, strict=True)
            ]

    def note(self, state: FriState, laid: float) -> None:
        """Take down what was laid over, if anybody wants to see it."""
        if self.samples is None or self.first_position_rad is None:
            return
        if state.release in _POSES:
            excursion = self._off_mm(state)
        else:
            pairs = zip(state.measured_position_rad, self.first_position_rad, strict=True)
            excursion = tuple(math.degrees(now - then) for now, then in pairs)
        stamp = state.time_stamp
        self.samples.append(Sample(stamp.seconds + stamp.nanoseconds * 1e-9, laid, excursion))

    def _off_mm(self, state: FriState) -> Vector:
        place = state.measured_pose[:3]
        first = self.first_pose = self.first_pose or place
        return tuple(now - then for now, then in zip(place, first, strict=True))


def run_sample(
    name: str,
    handler: SampleHandler,
    *,
    release: Release,
    port: int = CLIENT_PORT,
    bind: str = ANY_HOST,
    host: str | None = None,
    seconds: float | None,
    json_file: Path | None,
    plot: Path | None = None,
) -> None:
    """Run the handler until its time is over or Ctrl-C, print the summary, write result and plot; exits.

    Exit code 1 when no controller was heard, 2 for arguments or a port that cannot be used.
    """
    say = speaker(json_file)
    if plot is not None:
        handler.samples = deque(maxlen=MOST_SAMPLES)
    client = FriClient(handler, release=release, port=port, bind_host=bind, controller=host)
    run_client(name, client, seconds=seconds, say=say)
    result = _result(client, handler)
    say(_summary(result))
    if plot is not None and handler.samples:
        write_plot(name, plot, f"{name}, FRI {release.value}", *_panels(handler, release))
        say(f"wrote {plot}")
    if json_file is not None:
        write_json(name, json_file, result)
    raise typer.Exit(0 if result["received"] else 1)


def _result(client: FriClient, handler: SampleHandler) -> dict[str, Any]:
    result = {
        **session_figures(client),
        "states": dict(handler.states),
        "peak_excursion_rad": handler.peak_excursion_rad,
        "first_position": handler.first_position_rad,
        "last_position": handler.last_position_rad,
    }
    if client.session.release in _POSES and handler.mode is not ClientCommandMode.JOINT_POSITION:
        result["peak_excursion_mm"] = handler.peak_excursion_mm
    return result


def _summary(result: dict[str, Any]) -> str:
    if not result["received"]:
        return "no controller was heard"
    peaks = enumerate(result["peak_excursion_rad"], start=1)
    moved = [f"A{axis} {peak:.4f} rad" for axis, peak in peaks if peak >= 5e-5]
    moved += [
        f"flange {along} {peak:.1f} mm"
        for along, peak in zip("xyz", result.get("peak_excursion_mm", ()), strict=False)
        if peak >= 0.05
    ]
    malformed = sum(result["malformed"].values())
    return (
        f"{result['received']} messages received, {result['answers']} answered, {malformed} malformed; "
        f"largest measured excursion: {', '.join(moved) or 'none'}"
    )


def _panels(handler: SampleHandler, release: Release) -> tuple[list[float], tuple[Panel, Panel]]:
    """Return the times, and the diagrams of what was laid over and of where that has taken the arm."""
    samples = list(handler.samples or ())
    names = "xyz" if release in _POSES else JOINTS
    what = "flange, mm" if release in _POSES else "axes, degrees"
    moved = [Series(name, [sample.excursion[place] for sample in samples]) for place, name in enumerate(names)]
    return [sample.at_s - samples[0].at_s for sample in samples], (
        Panel(handler.laid, (Series("laid over", [sample.laid for sample in samples]),), steps=True),
        Panel(f"measured {what}\nfrom the first position", moved),
    )
