"""What all FRI samples share: options, running the client, its ends in words, the figures and the picture."""

import json
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import typer

from hil.client.fri import FriClient, FriState, HilError, NothingHeard, Release

MAX_SAMPLES: Final = 1_000_000
"""What a picture holds: the first quarter of an hour at 1 kHz."""


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


class Series(NamedTuple):
    """One line of a picture."""

    label: str
    values: Sequence[float]


class Panel(NamedTuple):
    """One diagram of a picture; ``steps``: values stay until the next one."""

    unit: str
    series: Sequence[Series]
    steps: bool = False


class SampleTimes:
    """Seconds since the first message, from the controller's time stamps; bounded."""

    def __init__(self) -> None:
        self.at_s: list[float] = []
        self._first_ns: int | None = None

    def add(self, state: FriState) -> bool:
        """Note the time of a message; return False when the recording is full."""
        if len(self.at_s) >= MAX_SAMPLES:
            return False
        stamp = state.time_stamp
        now_ns = stamp.seconds * 1_000_000_000 + stamp.nanoseconds
        if self._first_ns is None:
            self._first_ns = now_ns
        self.at_s.append((now_ns - self._first_ns) * 1e-9)
        return True


def speaker(json_file: Path | None) -> Callable[[str], None]:
    """Return where lines for the reader go: beside the result, when that goes to standard output."""
    return partial(typer.echo, err=json_file == Path("-"))


def run_client(name: str, client: FriClient, *, seconds: float | None, say: Callable[[str], None]) -> None:
    """Run until the session ends; an error of ours ends in one sentence and exit code 2."""
    try:
        with client:
            say(f"FRI {client.session.release.value} client on {client.local}")
            client.run(duration_s=seconds)
    except KeyboardInterrupt:
        say("interrupted")
    except NothingHeard as error:
        typer.echo(f"{name}: {error}", err=True)
    except HilError as error:
        typer.echo(f"{name}: {error}", err=True)
        raise typer.Exit(2) from None


def session_figures(client: FriClient) -> dict[str, Any]:
    """Return what every sample tells of its session."""
    session = client.session
    return {
        "release": session.release.value,
        "received": session.received,
        "answers": session.answered,
        "malformed": {outcome.value: count for outcome, count in session.malformed.items()},
    }


def write_json(name: str, file: Path, result: dict[str, Any]) -> None:
    """Write the figures to ``file``, or to standard output when it is ``-``."""
    text = json.dumps(result)
    if file == Path("-"):
        typer.echo(text)
        return
    try:
        file.write_text(f"{text}\n", encoding="utf-8")
    except OSError as error:
        typer.echo(f"{name}: cannot write {file}: {error.strerror}", err=True)
        raise typer.Exit(2) from None


def write_plot(name: str, picture: Path, title: str, at_s: Sequence[float], panels: Sequence[Panel]) -> None:
    """Draw the panels, one below the other, over one time axis."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(
        len(panels), 1, figsize=(10, 2.2 + 1.9 * len(panels)), sharex=True, layout="constrained", squeeze=False
    )
    figure.suptitle(title)
    for panel, axis in zip(panels, axes[:, 0], strict=True):
        for series in panel.series:
            if panel.steps:
                axis.step(at_s, series.values, where="post", label=series.label, linewidth=1.2)
            else:
                axis.plot(at_s, series.values, label=series.label, linewidth=1.2)
        axis.set_ylabel(panel.unit)
        axis.grid(alpha=0.3)
        axis.margins(x=0.005)
        if panel.series:
            axis.legend(frameon=False, ncols=7, loc="lower center", bbox_to_anchor=(0.5, 0.98), fontsize="small")
    axes[-1, 0].set_xlabel("time of the controller, s")
    try:
        figure.savefig(picture, dpi=110)
    except (OSError, ValueError) as error:
        typer.echo(f"{name}: cannot write {picture}: {getattr(error, 'strerror', None) or error}", err=True)
        raise typer.Exit(2) from None
    finally:
        plt.close(figure)
