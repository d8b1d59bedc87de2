"""What a piece of work costs: a control cycle, inverse kinematics, a cycle of drives."""

from dataclasses import asdict
from typing import Annotated, Final, NamedTuple

import typer
from rich.table import Table

from hil.cli.bench.options import AsJson, Backend, FriVersion, Motion, Robot, motion_named
from hil.cli.bench.shown import console_for, numbers, print_bounds, progress_bar
from hil.config.control import ControlConfig, ControlName
from hil.config.station import FriConfig, Mode, RobotConfig, ServoConfig
from hil.values.errors import ConfigurationError
from hil.values.fri import Release


class _Case(NamedTuple):
    """What one cycle is measured of, and what of where nothing else is asked for."""

    backend: str = "mujoco"
    fri_version: Release = Release.V1_15
    motion: str = "fri-overlay"
    control: ControlName = ControlName.POSITION
    mode: Mode = Mode.AUT


_USUAL: Final = _Case()


def cycle(  # noqa: PLR0917  # typer makes the options of the parameters
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = _USUAL.backend,
    fri_version: FriVersion = _USUAL.fri_version,
    motion: Motion = _USUAL.motion,
    control: Annotated[
        ControlName,
        typer.Option(help="Control of the arm under the FRI overlay; impedance comes with its torques or wrenches."),
    ] = _USUAL.control,
    mode: Annotated[Mode, typer.Option(help="Operation mode; T1 has two monitors more.")] = _USUAL.mode,
    cycles: Annotated[int, typer.Option(min=100, help="Cycles to measure.")] = 20_000,
    all_of_them: Annotated[
        bool, typer.Option("--all", help="A table of every motion, control mode, release and simulated robot side.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Cost of one control cycle, whole and by stage, in virtual time with one client at 1 ms."""
    if all_of_them:
        if _Case(backend, fri_version, motion, control, mode) != _USUAL:
            raise ConfigurationError("--all measures every case: of the other options --robot and --cycles go with it")
        _cycle_table(robot, cycles, as_json=as_json)
        return
    from tools.bench.clients import OVERLAY_UNDER, BenchMotion
    from tools.bench.cycle import as_dict, bench_cycle

    chosen = motion_named(motion)
    if chosen is not BenchMotion.FRI_OVERLAY and control is not ControlName.POSITION:
        raise ConfigurationError(f"--control {control} is measured under the FRI overlay, not under {chosen.value}")
    fri = None
    if chosen is BenchMotion.FRI_OVERLAY:
        fri = FriConfig(release=fri_version, overlay=OVERLAY_UNDER[control], control=ControlConfig(mode=control))
    servo = None if fri is not None else ServoConfig()
    config = RobotConfig(model=robot, backend=backend, mode=mode, enabled=True, fri=fri, servo=servo)
    with progress_bar("cycles", 2 * cycles) as (bar, task):
        report = bench_cycle(
            config, motion=chosen, cycles=cycles, progress=lambda done: bar.update(task, completed=done)
        )
    found = as_dict(report)
    if (console := console_for(found, as_json=as_json)) is None:
        return
    client = chosen.value if fri is None else f"FRI {fri_version}, {fri.overlay} under {control}"
    table = Table("stage", "p50 us", "p99 us", "max us", title=f"one cycle: {robot}, {backend}, {client}, {mode}")
    for name, figures in found["stages_us"].items():
        table.add_row(name, *numbers(figures))
    table.add_section()
    table.add_row("whole cycle, measured without the stages", *numbers(found["cycle_us"]))
    console.print(table)
    print_bounds(console, report.bounds())


def _cycle_table(robot: str, cycles: int, *, as_json: bool) -> None:
    from tools.bench.cycle import as_dict
    from tools.bench.cycle_table import BACKENDS, CASES, bench_table, bounds_of

    with progress_bar("cases", len(CASES) * len(BACKENDS)) as (bar, task):
        rows = list(bench_table(robot, cycles=cycles, progress=lambda done: bar.update(task, advance=done)))
    bounds = bounds_of(rows)
    found = {"cases": [{"case": row.case, **as_dict(row.report)} for row in rows]}
    if (console := console_for(found, as_json=as_json, bounds=bounds)) is None:
        return
    table = Table("", "robot side", "p50 us", "p99 us", "max us", "virtual time", title=f"one cycle: {robot}")
    for row in rows:
        figures = numbers(row.report.cycle.as_dict())
        table.add_row(row.case, row.report.backend, *figures, f"{row.report.virtual_time_factor:.1f} x")
    console.print(table)
    print_bounds(console, bounds)


def kinematics(
    robot: Robot = "lbr-iiwa-14-r820",
    poses: Annotated[int, typer.Option(min=10, help="Random poses to measure.")] = 20_000,
    as_json: AsJson = False,
) -> None:
    """Inverse kinematics: what one answer costs."""
    from tools.bench.kinematics import bench_kinematics

    report = bench_kinematics(robot, poses=poses)
    if (console := console_for(report.as_dict(), as_json=as_json)) is None:
        return
    table = Table("", "p50 us", "p99 us", "p99.9 us", "max us", title=f"{poses} random poses: {robot}")
    table.add_row("one pose, E1 and branch", *numbers(report.inverse.summary_us()))
    table.add_row("a destination near the arm", *numbers(report.nearest.summary_us()))
    table.add_row("a destination anywhere", *numbers(report.far.summary_us()))
    console.print(table)
    print_bounds(console, report.bounds())


def can402(
    robot: Robot = "lbr-iiwa-14-r820",
    cycles: Annotated[int, typer.Option(min=100, help="Cycles to measure.")] = 5000,
    as_json: AsJson = False,
) -> None:
    """A cycle of seven CiA 402 drives on python-can's virtual bus, the simulated drives included."""
    from backends.registry import check_backend
    from tools.bench.can402 import CYCLE_MS, bench_can402

    check_backend("can402")
    with progress_bar("cycles", cycles) as (bar, task):
        report = bench_can402(robot=robot, cycles=cycles, progress=lambda done: bar.update(task, completed=done))
    if (console := console_for(asdict(report), as_json=as_json, bounds=report.bounds())) is None:
        return
    table = Table("", "p50 us", "p99 us", "p99.9 us", "max us", title=f"seven drives, {report.cycles} cycles")
    table.add_row("write, SYNC, drives, read", *numbers(report.cycle_us))
    console.print(table)
    console.print(
        f"{report.over} cycles took more than {CYCLE_MS} ms; a bus of 1 Mbit/s would be full to "
        f"{report.bus_load_percent:g} %",
        highlight=False,
    )
    print_bounds(console, report.bounds())
