"""The real process: its start and its pace, with clients, arms and the view beside it."""

from dataclasses import asdict
from typing import Annotated

import typer
from rich.table import Table

from hil.cli.bench.options import AsJson, Backend, FriVersion, Robot
from hil.cli.bench.shown import console_for, numbers, print_bounds, progress_bar
from hil.values.errors import ConfigurationError
from hil.values.fri import Release


def start(
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    fri_version: FriVersion = Release.V1_15,
    repeats: Annotated[int, typer.Option(min=1, help="Times it is started.")] = 10,
    as_json: AsJson = False,
) -> None:
    """From the start of hil run to its first FRI datagram."""
    from tools.bench.start import bench_start

    with progress_bar("starts", repeats) as (bar, task):
        report = bench_start(
            robot=robot,
            backend=backend,
            release=fri_version,
            repeats=repeats,
            progress=lambda done: bar.update(task, completed=done),
        )
    bounds = report.bounds()
    if (console := console_for(asdict(report), as_json=as_json, bounds=bounds)) is None:
        return
    taken = report.first_packet_s
    console.print(
        f"start to first packet: median {report.median_s:.3f} s, {min(taken):.3f} to {max(taken):.3f} s in "
        f"{len(taken)} starts; an interpreter that does nothing takes {report.interpreter_s:.3f} s"
    )
    print_bounds(console, bounds)


def rate(  # noqa: PLR0917  # typer makes the options of the parameters
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    fri_version: FriVersion = Release.V1_15,
    seconds: Annotated[float, typer.Option(min=2.0, help="Length of the run.")] = 60.0,
    capture: Annotated[bool, typer.Option("--capture", help="Record all packets meanwhile.")] = False,
    realtime: Annotated[bool, typer.Option("--realtime", help="Ask for real-time scheduling.")] = False,
    load: Annotated[bool, typer.Option("--load", help="With the last core kept busy.")] = False,
    view: Annotated[bool, typer.Option("--view", help="Compare runs with the live view with runs without it.")] = False,
    repeats: Annotated[int, typer.Option(min=1, max=50, help="With --view: runs of each kind, in turn.")] = 3,
    as_json: AsJson = False,
) -> None:
    """Pacing, missed cycles and answers of the real process against a client process over UDP at 1 ms."""
    if view:
        if capture or load:
            raise ConfigurationError("--view compares pacing: it does not go with --capture or --load")
        _rate_view(robot, backend, fri_version, seconds, repeats, realtime=realtime, as_json=as_json)
        return
    from tools.bench.rate import bench_rate

    with progress_bar("seconds", seconds) as (bar, task):
        report = bench_rate(
            robot=robot,
            backend=backend,
            release=fri_version,
            seconds=seconds,
            capture=capture,
            realtime=realtime,
            load=load,
            progress=lambda done: bar.update(task, completed=done),
        )
    figures, bounds = report.robot, report.bounds()
    found = {"robot": figures, "client": report.client}
    if (console := console_for(found, as_json=as_json, bounds=bounds)) is None:
        return
    table = Table("", "p50 us", "p99 us", "p99.9 us", "max us", title=f"{seconds:g} s: {robot}, {backend}, 1 ms")
    for label, name in (("lateness", "lateness_us"), ("cycle", "cycle_us"), ("answer latency", "answer_latency_us")):
        table.add_row(label, *numbers(figures[name]))
    console.print(table)
    session = figures["session"]
    packets = figures["packets"]
    console.print(
        f"{figures['rate_hz']} Hz, {figures['ticks']} cycles, {figures['missed_cycles']} missed; "
        f"{packets['received']} answers of {packets['sent']}, {packets['dropped']['late']} late; "
        f"{session['changes']} changes of state, last quality {session['quality']}"
    )
    print_bounds(console, bounds)


def _rate_view(
    robot: str, backend: str, release: Release, seconds: float, repeats: int, *, realtime: bool, as_json: bool
) -> None:
    from hil.cli.bench.view_tables import print_rate_view
    from tools.bench.rate_view import bench_rate_view, length_s

    with progress_bar("seconds", length_s(seconds, repeats)) as (bar, task):
        report = bench_rate_view(
            robot=robot,
            backend=backend,
            release=release,
            seconds=seconds,
            repeats=repeats,
            realtime=realtime,
            progress=lambda done: bar.update(task, completed=done),
        )
    if (console := console_for(report.as_dict(), as_json=as_json)) is None:
        return
    print_rate_view(console, report, title=f"{repeats} runs of {seconds:g} s each, in turn: {robot}, {backend}, 1 ms")


def arms(  # noqa: PLR0917  # typer makes the options of the parameters
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    seconds: Annotated[float, typer.Option(min=2.0, help="Length of each run.")] = 20.0,
    listening: Annotated[bool, typer.Option("--listening", help="FRI clients only listen: no answers.")] = False,
    capture: Annotated[bool, typer.Option("--capture", help="Record all packets meanwhile.")] = False,
    load: Annotated[bool, typer.Option("--load", help="With the last core kept busy.")] = False,
    realtime: Annotated[bool, typer.Option("--realtime", help="Ask for real-time scheduling.")] = False,
    as_json: AsJson = False,
) -> None:
    """How many arms keep 1 kHz: 1, 2, 4 and 8 of them in one process, and 8 in two; an FRI client commands each."""
    from tools.bench.arms import Beside, bench_arms, bounds_of

    setups = ((1, 1), (2, 1), (4, 1), (8, 1), (8, 2))
    with progress_bar("seconds", len(setups) * seconds) as (bar, task):
        reports = bench_arms(
            setups,
            robot=robot,
            backend=backend,
            seconds=seconds,
            beside=Beside(listening, capture, load, realtime),
            progress=lambda done: bar.update(task, completed=done),
        )
    bounds = bounds_of(reports)
    found = {"runs": [asdict(report) for report in reports]}
    if (console := console_for(found, as_json=as_json, bounds=bounds)) is None:
        return
    table = Table(
        *("arms", "processes", "Hz", "lateness p99, us", "missed, %", "cycle p50, us", "commanded to the end", ""),
        title="the worst arm",
    )
    for report in reports:
        table.add_row(
            str(report.arms),
            str(report.processes),
            f"{report.rate_hz:.3f}",
            f"{report.lateness_p99_us:.0f}",
            f"{report.missed_percent:.3f}",
            f"{report.cycle_p50_us:.0f}",
            str(report.commanding),
            "keeps pace" if report.keeps_pace else "[red]does not[/red]",
        )
    console.print(table)
    print_bounds(console, bounds)


def view(
    robot: Robot = "lbr-iiwa-14-r820",
    arms: Annotated[int, typer.Option(min=1, max=4, help="With one arm, and with each number up to this.")] = 2,
    seconds: Annotated[float, typer.Option(min=2.0, help="Length of each run.")] = 20.0,
    as_json: AsJson = False,
) -> None:
    """Pictures a second of the view's page in a headless browser while arms move, and what they cost."""
    from hil.cli.bench.view_tables import print_view
    from tools.bench.view import bench_view, length_s

    with progress_bar("seconds", length_s(arms, seconds)) as (bar, task):
        report = bench_view(
            robot=robot, most_arms=arms, seconds=seconds, progress=lambda done: bar.update(task, completed=done)
        )
    if (console := console_for(report.as_dict(), as_json=as_json)) is None:
        return
    print_view(console, report, robot=robot)
    print_bounds(console, report.bounds())
