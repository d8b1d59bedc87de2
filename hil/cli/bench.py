"""``hil bench``: figures with machine and versions, as a table or as JSON."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.progress import Progress, TaskID
from rich.table import Table

from hil.cli.bench_peers import peers
from hil.config.control import ControlConfig, ControlName
from hil.config.station import FriConfig, Mode, Reaction, ReactionConfig, RobotConfig, ServoConfig
from hil.values.errors import ConfigurationError, UnknownName
from hil.values.fri import Release
from hil.values.robot import JOINT_COUNT, JOINT_NAMES

if TYPE_CHECKING:
    from tools.bench.bounds import Bound
    from tools.bench.clients import BenchMotion

app = typer.Typer(help="Measure: what a cycle costs, how well it is paced.", no_args_is_help=True)
app.command()(peers)

Robot = Annotated[str, typer.Option(help="Robot model.")]
Backend = Annotated[str, typer.Option(help="Robot side.")]
FriVersion = Annotated[Release, typer.Option(help="FRI release of the client.")]
Motion = Annotated[
    str, typer.Option(help="What moves the arm: fri-overlay, smart-servo or direct-servo, retargeted each cycle.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]


@app.command()
def cycle(  # noqa: PLR0917  # typer makes the options of the parameters
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    fri_version: FriVersion = Release.V1_15,
    motion: Motion = "fri-overlay",
    control: Annotated[
        ControlName,
        typer.Option(help="Control of the arm under the FRI overlay; impedance comes with its torques or wrenches."),
    ] = ControlName.POSITION,
    mode: Annotated[Mode, typer.Option(help="Operation mode; T1 has two monitors more.")] = Mode.AUT,
    cycles: Annotated[int, typer.Option(min=100, help="Cycles to measure.")] = 20_000,
    all_of_them: Annotated[
        bool, typer.Option("--all", help="A table of every motion, control mode, release and simulated robot side.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Cost of one control cycle, whole and by stage, in virtual time with one client at 1 ms."""
    if all_of_them:
        _cycle_table(robot, cycles, as_json=as_json)
        return
    from tools.bench.clients import OVERLAY_UNDER, BenchMotion
    from tools.bench.cycle import as_dict, bench_cycle

    chosen = _motion(motion)
    if chosen is not BenchMotion.FRI_OVERLAY and control is not ControlName.POSITION:
        raise ConfigurationError(f"--control {control} is measured under the FRI overlay, not under {chosen.value}")
    fri = None
    if chosen is BenchMotion.FRI_OVERLAY:
        fri = FriConfig(release=fri_version, overlay=OVERLAY_UNDER[control], control=ControlConfig(mode=control))
    servo = None if fri is not None else ServoConfig()
    config = RobotConfig(model=robot, backend=backend, mode=mode, enabled=True, fri=fri, servo=servo)
    with _progress("cycles", 2 * cycles) as (bar, task):
        report = bench_cycle(
            config, motion=chosen, cycles=cycles, progress=lambda done: bar.update(task, completed=done)
        )
    found = as_dict(report)
    if (console := _console_for(found, as_json=as_json)) is None:
        return
    client = chosen.value if fri is None else f"FRI {fri_version}, {fri.overlay} under {control}"
    table = Table("stage", "p50 us", "p99 us", "max us", title=f"one cycle: {robot}, {backend}, {client}, {mode}")
    for name, figures in found["stages_us"].items():
        table.add_row(name, *_numbers(figures))
    table.add_section()
    table.add_row("whole cycle, measured without the stages", *_numbers(found["cycle_us"]))
    console.print(table)
    _print_bounds(console, report.bounds())


def _cycle_table(robot: str, cycles: int, *, as_json: bool) -> None:
    from tools.bench.cycle import as_dict
    from tools.bench.cycle_table import BACKENDS, CASES, bench_table, bounds_of

    with _progress("cases", len(CASES) * len(BACKENDS)) as (bar, task):
        rows = list(bench_table(robot, cycles=cycles, progress=lambda done: bar.update(task, advance=done)))
    bounds = bounds_of(rows)
    cases = [{"case": row.case, **as_dict(row.report)} for row in rows]
    found = {"cases": cases, "bounds": [bound._asdict() for bound in bounds]}
    if (console := _console_for(found, as_json=as_json)) is None:
        return
    table = Table("", "robot side", "p50 us", "p99 us", "max us", "virtual time", title=f"one cycle: {robot}")
    for row in rows:
        figures = _numbers(row.report.cycle.as_dict())
        table.add_row(row.case, row.report.backend, *figures, f"{row.report.virtual_time_factor:.1f} x")
    console.print(table)
    _print_bounds(console, bounds)


@app.command()
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
    from tools.bench.machine import machine

    if view:
        if capture or load:
            raise ConfigurationError("--view compares pacing: it does not go with --capture or --load")
        _rate_view(robot, backend, fri_version, seconds, repeats, realtime=realtime, as_json=as_json)
        return
    from tools.bench.rate import bench_rate

    with _progress("seconds", seconds) as (bar, task):
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
    figures = report.robot
    if as_json:
        bounds = [bound._asdict() for bound in report.bounds()]
        typer.echo(json.dumps({"machine": machine(), "robot": figures, "client": report.client, "bounds": bounds}))
        return
    console = Console()
    _print_machine(console, machine())
    table = Table("", "p50 us", "p99 us", "p99.9 us", "max us", title=f"{seconds:g} s: {robot}, {backend}, 1 ms")
    for label, name in (("lateness", "lateness_us"), ("cycle", "cycle_us"), ("answer latency", "answer_latency_us")):
        table.add_row(label, *_numbers(figures[name]))
    console.print(table)
    session = figures["session"]
    packets = figures["packets"]
    console.print(
        f"{figures['rate_hz']} Hz, {figures['ticks']} cycles, {figures['missed_cycles']} missed; "
        f"{packets['received']} answers of {packets['sent']}, {packets['dropped']['late']} late; "
        f"{session['changes']} changes of state, last quality {session['quality']}"
    )
    _print_bounds(console, report.bounds())


def _rate_view(
    robot: str, backend: str, release: Release, seconds: float, repeats: int, *, realtime: bool, as_json: bool
) -> None:
    from hil.cli.bench_view import print_rate_view
    from tools.bench.rate_view import bench_rate_view, length_s

    with _progress("seconds", length_s(seconds, repeats)) as (bar, task):
        report = bench_rate_view(
            robot=robot,
            backend=backend,
            release=release,
            seconds=seconds,
            repeats=repeats,
            realtime=realtime,
            progress=lambda done: bar.update(task, completed=done),
        )
    if (console := _console_for(report.as_dict(), as_json=as_json)) is None:
        return
    print_rate_view(console, report, title=f"{repeats} runs of {seconds:g} s each, in turn: {robot}, {backend}, 1 ms")


@app.command()
def view(
    robot: Robot = "lbr-iiwa-14-r820",
    arms: Annotated[int, typer.Option(min=1, max=4, help="With one arm, and with each number up to this.")] = 2,
    seconds: Annotated[float, typer.Option(min=2.0, help="Length of each run.")] = 20.0,
    as_json: AsJson = False,
) -> None:
    """Pictures a second of the view's page in a headless browser while arms move, and what they cost."""
    from hil.cli.bench_view import print_view
    from tools.bench.view import bench_view, length_s

    with _progress("seconds", length_s(arms, seconds)) as (bar, task):
        report = bench_view(
            robot=robot, most_arms=arms, seconds=seconds, progress=lambda done: bar.update(task, completed=done)
        )
    if (console := _console_for(report.as_dict(), as_json=as_json)) is None:
        return
    print_view(console, report, robot=robot)
    _print_bounds(console, report.bounds())


@app.command()
def reaction(
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    profile: Annotated[Reaction, typer.Option("--reaction", help="Reaction time: cabinet or ideal.")] = (
        Reaction.CABINET
    ),
    as_json: AsJson = False,
) -> None:
    """System reaction time: from a destination's arrival to the effective motion, on the arm's measured position."""
    from tools.bench.reaction import CASES, bench_reaction

    config = RobotConfig(model=robot, backend=backend, servo=ServoConfig(), reaction=ReactionConfig(profile=profile))
    with _progress("steps", len(CASES) * JOINT_COUNT) as (bar, task):
        report = bench_reaction(config, progress=lambda done: bar.update(task, completed=done))
    if (console := _console_for(report.as_dict(), as_json=as_json)) is None:
        return
    table = Table("measured position moves after, ms", *JOINT_NAMES, title=f"reaction: {robot}, {backend}, {profile}")
    for found in report.reactions:
        table.add_row(found.case, *(f"{time_ms:.1f}" for time_ms in found.measured_ms))
        table.add_row("  its set point", *(f"{time_ms:.1f}" for time_ms in found.set_point_ms), style="dim")
    console.print(table)
    _print_bounds(console, report.bounds())


@app.command()
def servo(
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    seconds: Annotated[float, typer.Option(min=1.0, help="Length of each of the two runs.")] = 60.0,
    as_json: AsJson = False,
) -> None:
    """Destinations from an application process to the interpolator, over UDP: how quick, and whether any is lost."""
    from tools.bench.servo import bench_servo

    with _progress("seconds", 2 * seconds) as (bar, task):
        report = bench_servo(
            robot=robot, backend=backend, seconds=seconds, progress=lambda done: bar.update(task, completed=done)
        )
    if (console := _console_for(report.as_dict(), as_json=as_json)) is None:
        return
    answered, paced = report.answered, report.paced
    table = Table("", "p50 us", "p99 us", "p99.9 us", "max us", title=f"{answered.seconds:.0f} s: {robot}, {backend}")
    table.add_row("set_destination to interpolator", *_numbers(answered.to_interpolator.summary_us()))
    table.add_row("set_destination, whole call", *_numbers(answered.call.summary_us()))
    console.print(table)
    console.print(
        f"one after the other: {answered.sent} sent, {answered.motion.received} received, "
        f"{answered.motion.executed} executed, {answered.motion.superseded} superseded, {answered.lost} lost"
    )
    console.print(
        f"a thousand a second: {paced.asked} asked, {paced.acknowledged} acknowledged, {paced.replaced} replaced by a "
        f"newer one, {paced.motion.received} received, {paced.motion.executed} executed, "
        f"{paced.motion.superseded} superseded, {paced.lost} lost"
    )
    _print_bounds(console, report.bounds())


@app.command()
def answer(
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    fri_version: FriVersion = Release.V1_15,
    seconds: Annotated[float, typer.Option(min=2.0, help="Length of each of the two runs.")] = 30.0,
    as_json: AsJson = False,
) -> None:
    """From a packet in the kernel to the interpolator, and to the packet that follows, on the FRI and servo links."""
    from tools.bench.answer import bench_answer

    with _progress("seconds", 2 * seconds) as (bar, task):
        report = bench_answer(
            robot=robot,
            backend=backend,
            release=fri_version,
            seconds=seconds,
            progress=lambda done: bar.update(task, completed=done),
        )
    if (console := _console_for(report.as_dict(), as_json=as_json)) is None:
        return
    table = Table(
        "", "p50 us", "p99 us", "max us", title=f"packet in, from the kernel's stamp: {robot}, {backend}, 1 ms"
    )
    for one in report.links:
        table.add_row(f"{one.link}: to the interpolator", *_numbers(one.to_interpolator.as_dict()))
        table.add_row("  of that waiting for the cycle, by design", *_numbers(one.waiting.as_dict()), style="dim")
        table.add_row(f"{one.link}: to the packet out", *_numbers(one.to_packet_out.as_dict()))
        table.add_row("  of that the controller's own, from when the cycle was due", *_numbers(one.own.as_dict()))
        table.add_section()
    console.print(table)
    _print_bounds(console, report.bounds())


@app.command()
def kinematics(
    robot: Robot = "lbr-iiwa-14-r820",
    poses: Annotated[int, typer.Option(min=10, help="Random poses to measure.")] = 20_000,
    as_json: AsJson = False,
) -> None:
    """Inverse kinematics: what one answer costs."""
    from tools.bench.kinematics import bench_kinematics

    report = bench_kinematics(robot, poses=poses)
    if (console := _console_for(report.as_dict(), as_json=as_json)) is None:
        return
    table = Table("", "p50 us", "p99 us", "p99.9 us", "max us", title=f"{poses} random poses: {robot}")
    table.add_row("one pose, E1 and branch", *_numbers(report.inverse.summary_us()))
    table.add_row("a destination near the arm", *_numbers(report.nearest.summary_us()))
    table.add_row("a destination anywhere", *_numbers(report.far.summary_us()))
    console.print(table)
    _print_bounds(console, report.bounds())


@app.command()
def replay(  # noqa: PLR0917  # typer makes the options of the parameters
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    motion: Motion = "fri-overlay",
    seconds: Annotated[float, typer.Option(min=2.0, help="Length of the recording.")] = 30.0,
    repeats: Annotated[int, typer.Option(min=1, max=100, help="Replays of it.")] = 3,
    as_json: AsJson = False,
) -> None:
    """Replay of a recording of ours at 1 ms: times real time, and memory. Every replay must be identical."""
    from tools.bench.clients import BenchMotion
    from tools.bench.replay import as_dict, bench_replay

    chosen = _motion(motion)
    links: dict[str, Any] = {"fri": FriConfig()} if chosen is BenchMotion.FRI_OVERLAY else {"servo": ServoConfig()}
    config = RobotConfig(model=robot, backend=backend, **links)
    with _progress("seconds", 2 * seconds) as (bar, task):
        report = bench_replay(
            config,
            motion=chosen,
            seconds=seconds,
            repeats=repeats,
            progress=lambda done: bar.update(task, completed=done),
        )
    found = as_dict(report)
    if (console := _console_for(found, as_json=as_json)) is None:
        return
    table = Table("", "", title=f"replay: {robot}, {backend}, {chosen.value}")
    table.add_row("recording", f"{report.recorded_s:.1f} s, {report.datagrams} datagrams, {report.file_mb:.1f} MB")
    table.add_row("replayed in", ", ".join(f"{took_s:.2f} s" for took_s in report.replayed_s))
    table.add_row("real-time factor, fastest", f"{report.factor:.1f}")
    table.add_row("a cycle", f"{found['us_a_cycle']} us, reading and comparing included")
    table.add_row("memory", f"{report.resident_mb:.0f} MB, grown by {report.grown_mb:.1f} MB from replay to replay")
    console.print(table)
    _print_bounds(console, report.bounds())


@app.command()
def chain(  # noqa: PLR0917  # typer makes the options of the parameters
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    fri_version: FriVersion = Release.V1_15,
    send_period: Annotated[int, typer.Option(metavar="MS", help="1, 2, 4 or 5.")] = 1,
    seconds: Annotated[float, typer.Option(min=3.0, help="Length of each of the two runs.")] = 15.0,
    as_json: AsJson = False,
) -> None:
    """What the link to a Cabinet costs: its message to our answer, beside that of a plain FRI client, over UDP."""
    from dataclasses import asdict

    from tools.bench.chain import bench_chain

    with _progress("seconds", 2 * seconds) as (bar, task):
        report = bench_chain(
            robot=robot,
            backend=backend,
            release=fri_version,
            send_period_ms=send_period,
            seconds=seconds,
            progress=lambda done: bar.update(task, completed=done),
        )
    bounds = report.bounds()
    found = {**asdict(report), "bounds": [bound._asdict() for bound in bounds]}
    if (console := _console_for(found, as_json=as_json)) is None:
        return
    table = Table("", "p50 us", "p99 us", "p99.9 us", "max us", title=f"answer latency at {send_period} ms")
    table.add_row("plain FRI client", *_numbers(report.plain["answer_latency_us"]))
    table.add_row("controller on the backend cabinet", *_numbers(report.cabinet["answer_latency_us"]))
    table.add_row("a cycle of that controller", *_numbers(report.controller["cycle_us"]))
    console.print(table)
    _print_bounds(console, bounds)


@app.command()
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
    from dataclasses import asdict

    from tools.bench.arms import Beside, bench_arms, bounds_of

    setups = ((1, 1), (2, 1), (4, 1), (8, 1), (8, 2))
    with _progress("seconds", len(setups) * seconds) as (bar, task):
        reports = bench_arms(
            setups,
            robot=robot,
            backend=backend,
            seconds=seconds,
            beside=Beside(listening, capture, load, realtime),
            progress=lambda done: bar.update(task, completed=done),
        )
    bounds = bounds_of(reports)
    runs = [asdict(report) for report in reports]
    found = {"runs": runs, "bounds": [bound._asdict() for bound in bounds]}
    if (console := _console_for(found, as_json=as_json)) is None:
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
    _print_bounds(console, bounds)


@app.command()
def start(
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    fri_version: FriVersion = Release.V1_15,
    repeats: Annotated[int, typer.Option(min=1, help="Times it is started.")] = 10,
    as_json: AsJson = False,
) -> None:
    """From the start of hil run to its first FRI datagram."""
    from dataclasses import asdict

    from tools.bench.start import bench_start

    with _progress("starts", repeats) as (bar, task):
        report = bench_start(
            robot=robot,
            backend=backend,
            release=fri_version,
            repeats=repeats,
            progress=lambda done: bar.update(task, completed=done),
        )
    bounds = report.bounds()
    found = {**asdict(report), "bounds": [bound._asdict() for bound in bounds]}
    if (console := _console_for(found, as_json=as_json)) is None:
        return
    taken = report.first_packet_s
    console.print(
        f"start to first packet: median {report.median_s:.3f} s, {min(taken):.3f} to {max(taken):.3f} s in "
        f"{len(taken)} starts; an interpreter that does nothing takes {report.interpreter_s:.3f} s"
    )
    _print_bounds(console, bounds)


@app.command()
def memory(
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    minutes: Annotated[float, typer.Option(min=0.1, help="Of virtual time.")] = 10.0,
    as_json: AsJson = False,
) -> None:
    """What a controller keeps resident while a client commands, and whether that grows."""
    from dataclasses import asdict

    from tools.bench.memory import bench_memory

    config = RobotConfig(model=robot, backend=backend, fri=FriConfig())
    with _progress("virtual minutes", minutes) as (bar, task):
        report = bench_memory(config, minutes=minutes, progress=lambda done: bar.update(task, completed=done))
    bounds = report.bounds()
    found = {**asdict(report), "bounds": [bound._asdict() for bound in bounds]}
    if (console := _console_for(found, as_json=as_json)) is None:
        return
    table = Table("virtual time, min", "resident, MB", "Python's blocks", title="memory")
    every = max(1, len(report.resident_mb) // 10)
    for place in range(0, len(report.resident_mb), every):
        at_min = place * report.virtual_s / 60.0 / (len(report.resident_mb) - 1)
        table.add_row(f"{at_min:.1f}", f"{report.resident_mb[place]:.2f}", str(report.blocks[place]))
    console.print(table)
    console.print(f"Python's blocks: {report.blocks_a_minute:+.1f} a minute of virtual time")
    _print_bounds(console, bounds)


@app.command()
def kst(
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    seconds: Annotated[float, typer.Option(min=1.0, help="Length of each loop.")] = 15.0,
    nagle: Annotated[bool, typer.Option("--nagle", help="With Nagle's algorithm on at the server.")] = False,
    as_json: AsJson = False,
) -> None:
    """Set-points a second that a KST program gets acknowledged, waiting for each, with an FRI client that watches."""
    from dataclasses import asdict

    from tools.bench.kst import LOOPS, bench_kst

    with _progress("seconds", len(LOOPS) * seconds) as (bar, task):
        report = bench_kst(
            robot=robot,
            backend=backend,
            seconds=seconds,
            nagle=nagle,
            progress=lambda done: bar.update(task, completed=done),
        )
    bounds = report.bounds()
    found = {**asdict(report), "bounds": [bound._asdict() for bound in bounds]}
    if (console := _console_for(found, as_json=as_json)) is None:
        return
    table = Table("set-points", "Hz", "p50 ms", "p99 ms", "p99.9 ms", "max ms", title="set-point to reply")
    for loop in report.loops:
        table.add_row(loop.name, f"{loop.rate_hz:.0f}", *(f"{value:.3f}" for value in loop.round_trip_ms.values()))
    console.print(table)
    console.print(
        f"the controller meanwhile: {report.robot['rate_hz']:.2f} Hz, lateness p99 "
        f"{report.robot['lateness_us']['p99']:.0f} us, {report.robot['missed_cycles']} cycles missed"
    )
    _print_bounds(console, bounds)


@app.command()
def campaign(
    backend: Backend = "mujoco",
    seeds: Annotated[int, typer.Option(min=1, help="Four scenarios of each seed.")] = 25,
    workers: Annotated[list[int] | None, typer.Option(min=1, help="Worker processes; may repeat. 1 and 2.")] = None,
    as_json: AsJson = False,
) -> None:
    """Scenarios a minute that hil campaign plays, with one worker and with two."""
    from tools.bench.campaign import bench_campaign

    counts = workers or [1, 2]
    with _progress("scenarios", 4 * seeds * len(counts)) as (bar, task):
        report = bench_campaign(
            backend=backend, seeds=seeds, workers=counts, progress=lambda done: bar.update(task, advance=done)
        )
    if (console := _console_for(report.as_dict(), as_json=as_json)) is None:
        return
    table = Table("workers", "scenarios", "s", "scenarios a minute", "virtual time", title=f"campaign: {backend}")
    for run in report.runs:
        figures = f"{run.seconds:.1f}", f"{run.per_minute:.0f}", f"{run.factor:.1f} x"
        table.add_row(str(run.workers), str(run.scenarios), *figures)
    console.print(table)
    _print_bounds(console, report.bounds())


@app.command()
def can402(
    robot: Robot = "lbr-iiwa-14-r820",
    cycles: Annotated[int, typer.Option(min=100, help="Cycles to measure.")] = 5000,
    as_json: AsJson = False,
) -> None:
    """A cycle of seven CiA 402 drives on python-can's virtual bus, the simulated drives included."""
    from dataclasses import asdict

    from backends.registry import check_backend
    from tools.bench.can402 import CYCLE_MS, bench_can402

    check_backend("can402")
    with _progress("cycles", cycles) as (bar, task):
        report = bench_can402(robot=robot, cycles=cycles, progress=lambda done: bar.update(task, completed=done))
    found = {**asdict(report), "bounds": [bound._asdict() for bound in report.bounds()]}
    if (console := _console_for(found, as_json=as_json)) is None:
        return
    table = Table("", "p50 us", "p99 us", "p99.9 us", "max us", title=f"seven drives, {report.cycles} cycles")
    table.add_row("write, SYNC, drives, read", *_numbers(report.cycle_us))
    console.print(table)
    console.print(
        f"{report.over} cycles took more than {CYCLE_MS} ms; a bus of 1 Mbit/s would be full to "
        f"{report.bus_load_percent:g} %",
        highlight=False,
    )
    _print_bounds(console, report.bounds())


def _motion(name: str) -> "BenchMotion":
    from tools.bench.clients import BenchMotion

    try:
        return BenchMotion(name)
    except ValueError:
        raise UnknownName("motion", name, [known.value for known in BenchMotion]) from None


@contextmanager
def _progress(what: str, total: float) -> Iterator[tuple[Progress, TaskID]]:
    with Progress(console=Console(stderr=True), transient=True) as bar:
        yield bar, bar.add_task(what, total=total)


def _numbers(figures: dict[str, Any]) -> list[str]:
    return ["-" if figure is None else f"{figure:.1f}" for figure in figures.values()]


def _console_for(found: dict[str, Any], *, as_json: bool) -> Console | None:
    """Print what was found as JSON, machine included, and return None; else print the machine, and return a console."""
    from tools.bench.machine import machine

    if as_json:
        typer.echo(json.dumps({"machine": machine(), **found}, indent=2))
        return None
    console = Console()
    _print_machine(console, machine())
    return console


def _print_machine(console: Console, facts: dict[str, str]) -> None:
    console.print(", ".join(f"{name} {value}" for name, value in facts.items()), style="dim")


def _print_bounds(console: Console, bounds: "list[Bound]") -> None:
    table = Table("figure", "measured", "bound", "")
    for bound in bounds:
        verdict = "[green]kept[/green]" if bound.kept else "[red]MISSED[/red]"
        table.add_row(bound.name, f"{bound.figure:g} {bound.unit}", bound.bound, verdict)
    console.print(table)
