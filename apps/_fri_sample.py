"""What the FRI samples share: what they watch, how they run, what they print, and the plot."""

import json
import math
from collections import Counter, deque
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import typer

from hil.client.fri import (
    ANY_HOST,
    CLIENT_PORT,
    ClientCommandMode,
    FriClient,
    FriHandler,
    FriState,
    HilError,
    NothingHeard,
    Release,
    SessionState,
    Vector,
)

MOST_SAMPLES: Final = 200_000
"""Of a plot; the last ones are kept."""
_POSES: Final = (Release.V2_5, Release.V2_7)
_OVERLAYS: Final = {
    ClientCommandMode.JOINT_POSITION: "joint-position",
    ClientCommandMode.TORQUE: "torque",
    ClientCommandMode.WRENCH: "wrench",
    ClientCommandMode.CARTESIAN_POSE: "cartesian-pose",
}

FriVersion = Annotated[Release, typer.Option(help="Release the controller speaks.")]
Port = Annotated[int, typer.Option(help="Own UDP port.")]
Bind = Annotated[str, typer.Option(metavar="ADDR", help="Own address; 0.0.0.0 is all of them.")]
Host = Annotated[
    str | None, typer.Option(metavar="HOST[:PORT]", help="Controller: hear no other. Default: whoever sends.")
]
Seconds = Annotated[float | None, typer.Option(min=0.0, help="End after so many seconds.")]
JsonFile = Annotated[
    Path | None, typer.Option("--json", metavar="FILE|-", help="Write the result; -: standard output.")
]
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


def speaker(json_file: Path | None) -> Callable[[str], None]:
    """Return where lines for the reader go: beside the result, when that goes to standard output."""
    return partial(typer.echo, err=json_file == Path("-"))


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
    try:
        with client:
            say(f"FRI {release.value} client on {client.local}")
            client.run(duration_s=seconds)
    except KeyboardInterrupt:
        say("interrupted")
    except NothingHeard as error:
        typer.echo(f"{name}: {error}", err=True)
    except HilError as error:
        typer.echo(f"{name}: {error}", err=True)
        raise typer.Exit(2) from None
    result = _result(client, handler)
    say(_summary(result))
    if plot is not None and handler.samples:
        _plot(handler, release, name, plot)
        say(f"wrote {plot}")
    if json_file is not None:
        _write(name, json_file, result)
    raise typer.Exit(0 if result["received"] else 1)


def _result(client: FriClient, handler: SampleHandler) -> dict[str, Any]:
    session = client.session
    result = {
        "release": session.release.value,
        "received": session.received,
        "answers": session.answered,
        "malformed": {outcome.value: count for outcome, count in session.malformed.items()},
        "states": dict(handler.states),
        "peak_excursion_rad": handler.peak_excursion_rad,
        "first_position": handler.first_position_rad,
        "last_position": handler.last_position_rad,
    }
    if session.release in _POSES and handler.mode is not ClientCommandMode.JOINT_POSITION:
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


def _write(name: str, file: Path, result: dict[str, Any]) -> None:
    text = json.dumps(result)
    if file == Path("-"):
        typer.echo(text)
    else:
        try:
            file.write_text(f"{text}\n", encoding="utf-8")
        except OSError as error:
            typer.echo(f"{name}: cannot write {file}: {error.strerror}", err=True)
            raise typer.Exit(2) from None


def _plot(handler: SampleHandler, release: Release, name: str, picture: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    samples = list(handler.samples or ())
    at_s = [sample.at_s - samples[0].at_s for sample in samples]
    figure, (over, moved) = plt.subplots(2, 1, figsize=(10, 6), sharex=True, layout="constrained")
    figure.suptitle(f"{name}, FRI {release.value}")
    over.step(at_s, [sample.laid for sample in samples], where="post", color="#12304f", linewidth=1.0)
    over.set_ylabel(handler.laid)
    poses = release in _POSES
    for place in range(len(samples[0].excursion)):
        label = "xyz"[place] if poses else f"A{place + 1}"
        moved.plot(at_s, [sample.excursion[place] for sample in samples], label=label, linewidth=1.0)
    moved.set_ylabel(f"measured {'flange, mm' if poses else 'axes, degrees'}\nfrom the first position")
    moved.set_xlabel("time of the controller, s")
    moved.legend(frameon=False, ncols=7, loc="upper center", bbox_to_anchor=(0.5, 1.12))
    for panel in (over, moved):
        panel.grid(alpha=0.3)
        panel.margins(x=0.005)
    figure.savefig(picture, dpi=110)
    plt.close(figure)
