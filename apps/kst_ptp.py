"""Joint motion, lines and a circle over KST: ``python -m apps.kst_ptp --plot path.png``."""

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from apps._kst_sample import DEFAULT_CONTROLLER, START_RAD, Controller, listed
from apps._servo_sample import run_app, save_figure
from hil.client.kst import KstClient
from hil.client.servo import StatisticTimer

Points = list[tuple[str, tuple[float, ...]]]
RADIUS_MM = 50.0
SQUARE_ENDS = 4
"""Of the motions, the one that ends the square."""


def main(
    controller: Controller = DEFAULT_CONTROLLER,
    speed: Annotated[float, typer.Option(metavar="MM/S", min=1.0, help="Speed of lines and circle.")] = 100.0,
    plot: Annotated[Path | None, typer.Option(metavar="FILE.png", help="Draw where the tool was.")] = None,
) -> None:
    """Go to the start, along a square, and round a circle. Exit code 2 where a motion is refused."""
    run_app("kst_ptp", partial(_move, controller, speed, plot))


def _move(controller: str, speed_mm_s: float, plot: Path | None) -> None:
    points: Points = []
    with KstClient(controller) as arm:
        _timed(arm, points, "joint motion to the start", lambda: arm.move_joints(START_RAD, velocity_rel=0.3))
        for name, way in (
            ("line, +y", (0.0, 80.0, 0.0)),
            ("line, +z", (0.0, 0.0, 80.0)),
            ("line, -y", (0.0, -80.0, 0.0)),
            ("line, -z", (0.0, 0.0, -80.0)),
        ):
            _timed(arm, points, name, partial(arm.move_by, way, speed_mm_s=speed_mm_s))
        x, y, z, *angles = arm.pose()
        auxiliary = (x, y + RADIUS_MM, z + RADIUS_MM, *angles)
        end = (x, y + 2.0 * RADIUS_MM, z, *angles)
        _timed(arm, points, "half a circle", lambda: arm.move_circle(auxiliary, end, speed_mm_s=speed_mm_s))
        _timed(arm, points, "line back", lambda: arm.move_line((x, y, z, *angles), speed_mm_s=speed_mm_s))
    begun, ended = points[SQUARE_ENDS][1], points[-1][1]
    typer.echo(f"it came back to where the square ended within {math.dist(begun[:3], ended[:3]):.2f} mm")
    if plot is not None:
        _plot(points, plot)
        typer.echo(f"wrote {plot}")


def _timed(arm: KstClient, points: Points, name: str, move: Callable[[], None]) -> None:
    """Do a motion, and say how long it took and where it ended."""
    timing = StatisticTimer()
    with timing.new_time_step():
        move()
    pose = arm.pose()
    points.append((name, pose))
    typer.echo(f"{name:<28}{timing.mean_ms / 1e3:6.2f} s   {listed(pose, 2)}")


def _plot(points: Points, picture: Path) -> None:
    """Draw the poses between the motions: during one a program that waits for its end sees none."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, panel = plt.subplots(figsize=(9, 5), layout="constrained")
    figure.suptitle("KST: where the tool was after each motion")
    places: dict[tuple[int, int], list[int]] = {}
    for number, (name, pose) in enumerate(points, 1):
        places.setdefault((round(pose[1]), round(pose[2])), []).append(number)
        panel.plot([], [], " ", label=f"{number}  {name}")
    panel.plot([pose[1] for _, pose in points], [pose[2] for _, pose in points], color="#b0bec5", linewidth=1.0)
    for place, numbers in places.items():
        panel.scatter(*place, color="#12304f", zorder=2)
        panel.annotate(", ".join(map(str, numbers)), place, xytext=(7, 7), textcoords="offset points")
    panel.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=0)
    panel.margins(0.15)
    panel.set_xlabel("y of the robot base, mm")
    panel.set_ylabel("z of the robot base, mm")
    panel.set_aspect("equal")
    panel.grid(alpha=0.3)
    save_figure(figure, (), picture)


if __name__ == "__main__":
    typer.run(main)
