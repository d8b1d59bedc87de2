"""From packet to packet: FRI, servo link, a Cabinet, KST programs."""

from dataclasses import asdict
from typing import Annotated

import typer
from rich.table import Table

from hil.cli.bench.options import AsJson, Backend, FriVersion, Robot
from hil.cli.bench.shown import console_for, numbers, print_bounds, progress_bar
from hil.values.fri import Release


def answer(
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    fri_version: FriVersion = Release.V1_15,
    seconds: Annotated[float, typer.Option(min=2.0, help="Length of each of the two runs.")] = 30.0,
    as_json: AsJson = False,
) -> None:
    """From a packet in the kernel to the interpolator, and to the packet that follows, on the FRI and servo links."""
    from tools.bench.answer import bench_answer

    with progress_bar("seconds", 2 * seconds) as (bar, task):
        report = bench_answer(
            robot=robot,
            backend=backend,
            release=fri_version,
            seconds=seconds,
            progress=lambda done: bar.update(task, completed=done),
        )
    if (console := console_for(report.as_dict(), as_json=as_json)) is None:
        return
    table = Table(
        "", "p50 us", "p99 us", "max us", title=f"packet in, from the kernel's stamp: {robot}, {backend}, 1 ms"
    )
    for one in report.links:
        table.add_row(f"{one.link}: to the interpolator", *numbers(one.to_interpolator.as_dict()))
        table.add_row("  of that waiting for the cycle, by design", *numbers(one.waiting.as_dict()), style="dim")
        table.add_row(f"{one.link}: to the packet out", *numbers(one.to_packet_out.as_dict()))
        table.add_row("  of that the controller's own, from when the cycle was due", *numbers(one.own.as_dict()))
        table.add_section()
    console.print(table)
    print_bounds(console, report.bounds())


def servo(
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    seconds: Annotated[float, typer.Option(min=1.0, help="Length of each of the two runs.")] = 60.0,
    as_json: AsJson = False,
) -> None:
    """Destinations from an application process to the interpolator, over UDP: how quick, and whether any is lost."""
    from tools.bench.servo import bench_servo

    with progress_bar("seconds", 2 * seconds) as (bar, task):
        report = bench_servo(
            robot=robot, backend=backend, seconds=seconds, progress=lambda done: bar.update(task, completed=done)
        )
    if (console := console_for(report.as_dict(), as_json=as_json)) is None:
        return
    answered, paced = report.answered, report.paced
    table = Table("", "p50 us", "p99 us", "p99.9 us", "max us", title=f"{answered.seconds:.0f} s: {robot}, {backend}")
    table.add_row("set_destination to interpolator", *numbers(answered.to_interpolator.summary_us()))
    table.add_row("set_destination, whole call", *numbers(answered.call.summary_us()))
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
    print_bounds(console, report.bounds())


def chain(  # noqa: PLR0917  # typer makes the options of the parameters
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    fri_version: FriVersion = Release.V1_15,
    send_period: Annotated[int, typer.Option(metavar="MS", help="1, 2, 4 or 5.")] = 1,
    seconds: Annotated[float, typer.Option(min=3.0, help="Length of each of the two runs.")] = 15.0,
    as_json: AsJson = False,
) -> None:
    """What the link to a Cabinet costs: its message to our answer, beside that of a plain FRI client, over UDP."""
    from tools.bench.chain import bench_chain

    with progress_bar("seconds", 2 * seconds) as (bar, task):
        report = bench_chain(
            robot=robot,
            backend=backend,
            release=fri_version,
            send_period_ms=send_period,
            seconds=seconds,
            progress=lambda done: bar.update(task, completed=done),
        )
    bounds = report.bounds()
    if (console := console_for(asdict(report), as_json=as_json, bounds=bounds)) is None:
        return
    table = Table("", "p50 us", "p99 us", "p99.9 us", "max us", title=f"answer latency at {send_period} ms")
    table.add_row("plain FRI client", *numbers(report.plain["answer_latency_us"]))
    table.add_row("controller on the backend cabinet", *numbers(report.cabinet["answer_latency_us"]))
    table.add_row("a cycle of that controller", *numbers(report.controller["cycle_us"]))
    console.print(table)
    print_bounds(console, bounds)


def kst(
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    seconds: Annotated[float, typer.Option(min=1.0, help="Length of each loop.")] = 15.0,
    nagle: Annotated[bool, typer.Option("--nagle", help="With Nagle's algorithm on at the server.")] = False,
    as_json: AsJson = False,
) -> None:
    """Set-points a second that a KST program gets acknowledged, waiting for each, with an FRI client that watches."""
    from tools.bench.kst import LOOPS, bench_kst

    with progress_bar("seconds", len(LOOPS) * seconds) as (bar, task):
        report = bench_kst(
            robot=robot,
            backend=backend,
            seconds=seconds,
            nagle=nagle,
            progress=lambda done: bar.update(task, completed=done),
        )
    bounds = report.bounds()
    if (console := console_for(asdict(report), as_json=as_json, bounds=bounds)) is None:
        return
    table = Table("set-points", "Hz", "p50 ms", "p99 ms", "p99.9 ms", "max ms", title="set-point to reply")
    for loop in report.loops:
        table.add_row(loop.name, f"{loop.rate_hz:.0f}", *(f"{value:.3f}" for value in loop.round_trip_ms.values()))
    console.print(table)
    console.print(
        f"the controller meanwhile: {report.robot['rate_hz']:.2f} Hz, lateness p99 "
        f"{report.robot['lateness_us']['p99']:.0f} us, {report.robot['missed_cycles']} cycles missed"
    )
    print_bounds(console, bounds)
