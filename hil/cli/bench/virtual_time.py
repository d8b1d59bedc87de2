"""In virtual time: replays, reaction times, memory, campaigns."""

from dataclasses import asdict
from typing import Annotated, Any

import typer
from rich.table import Table

from hil.cli.bench.options import AsJson, Backend, Motion, Robot, motion_named
from hil.cli.bench.shown import console_for, print_bounds, progress_bar
from hil.config.station import FriConfig, Reaction, ReactionConfig, RobotConfig, ServoConfig
from hil.values.robot import JOINT_COUNT, JOINT_NAMES


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

    chosen = motion_named(motion)
    links: dict[str, Any] = {"fri": FriConfig()} if chosen is BenchMotion.FRI_OVERLAY else {"servo": ServoConfig()}
    config = RobotConfig(model=robot, backend=backend, **links)
    with progress_bar("seconds", 2 * seconds) as (bar, task):
        report = bench_replay(
            config,
            motion=chosen,
            seconds=seconds,
            repeats=repeats,
            progress=lambda done: bar.update(task, completed=done),
        )
    found = as_dict(report)
    if (console := console_for(found, as_json=as_json)) is None:
        return
    table = Table("", "", title=f"replay: {robot}, {backend}, {chosen.value}")
    table.add_row("recording", f"{report.recorded_s:.1f} s, {report.datagrams} datagrams, {report.file_mb:.1f} MB")
    table.add_row("replayed in", ", ".join(f"{took_s:.2f} s" for took_s in report.replayed_s))
    table.add_row("real-time factor, fastest", f"{report.factor:.1f}")
    table.add_row("a cycle", f"{found['us_a_cycle']} us, reading and comparing included")
    table.add_row("memory", f"{report.resident_mb:.0f} MB, grown by {report.grown_mb:.1f} MB from replay to replay")
    console.print(table)
    print_bounds(console, report.bounds())


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
    with progress_bar("steps", len(CASES) * JOINT_COUNT) as (bar, task):
        report = bench_reaction(config, progress=lambda done: bar.update(task, completed=done))
    if (console := console_for(report.as_dict(), as_json=as_json)) is None:
        return
    table = Table("measured position moves after, ms", *JOINT_NAMES, title=f"reaction: {robot}, {backend}, {profile}")
    for found in report.reactions:
        table.add_row(found.case, *(f"{time_ms:.1f}" for time_ms in found.measured_ms))
        table.add_row("  its set point", *(f"{time_ms:.1f}" for time_ms in found.set_point_ms), style="dim")
    console.print(table)
    print_bounds(console, report.bounds())


def memory(
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    minutes: Annotated[float, typer.Option(min=0.1, help="Of virtual time.")] = 10.0,
    as_json: AsJson = False,
) -> None:
    """What a controller keeps resident while a client commands, and whether that grows."""
    from tools.bench.memory import bench_memory

    config = RobotConfig(model=robot, backend=backend, fri=FriConfig())
    with progress_bar("virtual minutes", minutes) as (bar, task):
        report = bench_memory(config, minutes=minutes, progress=lambda done: bar.update(task, completed=done))
    bounds = report.bounds()
    if (console := console_for(asdict(report), as_json=as_json, bounds=bounds)) is None:
        return
    table = Table("virtual time, min", "resident, MB", "Python's blocks", title="memory")
    every = max(1, len(report.resident_mb) // 10)
    for place in range(0, len(report.resident_mb), every):
        at_min = place * report.virtual_s / 60.0 / (len(report.resident_mb) - 1)
        table.add_row(f"{at_min:.1f}", f"{report.resident_mb[place]:.2f}", str(report.blocks[place]))
    console.print(table)
    console.print(f"Python's blocks: {report.blocks_a_minute:+.1f} a minute of virtual time")
    print_bounds(console, bounds)


def campaign(
    backend: Backend = "mujoco",
    seeds: Annotated[int, typer.Option(min=1, help="Four scenarios of each seed.")] = 25,
    workers: Annotated[list[int] | None, typer.Option(min=1, help="Worker processes; may repeat. 1 and 2.")] = None,
    as_json: AsJson = False,
) -> None:
    """Scenarios a minute that hil campaign plays, with one worker and with two."""
    from tools.bench.campaign import bench_campaign

    counts = workers or [1, 2]
    with progress_bar("scenarios", 4 * seeds * len(counts)) as (bar, task):
        report = bench_campaign(
            backend=backend, seeds=seeds, workers=counts, progress=lambda done: bar.update(task, advance=done)
        )
    if (console := console_for(report.as_dict(), as_json=as_json)) is None:
        return
    table = Table("workers", "scenarios", "s", "scenarios a minute", "virtual time", title=f"campaign: {backend}")
    for run in report.runs:
        figures = f"{run.seconds:.1f}", f"{run.per_minute:.0f}", f"{run.factor:.1f} x"
        table.add_row(str(run.workers), str(run.scenarios), *figures)
    console.print(table)
    print_bounds(console, report.bounds())
