"""The pictures of docs/control.md: ``python -m tools.control_plots --folder docs``.

The control stage and the MuJoCo arm alone, in virtual time: set points come from here, not from a motion, so that a
step is a step.
"""

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

import typer

from backends.mujoco import MujocoBackend
from backends.robots import load_description, load_pinocchio
from hil.core.control.stage import ControlStage
from hil.core.kinematics.redundancy import nearest
from hil.core.model import ArmModel
from hil.core.motion.executive import MotionExecutive
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.arm import ArmState, Push, seven
from hil.values.control import (
    CartesianImpedanceControlMode,
    ControlModeSettings,
    ControlSetup,
    PositionControlMode,
    by_translation,
    create_lissajous_pattern,
    create_spiral_pattern,
)
from hil.values.control import CartesianPlane as Plane
from hil.values.errors import HilError
from hil.values.load import NO_LOAD
from hil.values.pose import Pose
from hil.values.robot import Seven

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROBOT: Final = "lbr-iiwa-14-r820"
CYCLE_NS: Final = 1_000_000
DAMPING: Final = (0.3, 0.7, 1.0)
STEP_M: Final = 0.005
WALL_M: Final = 0.015
WALL_N_M: Final = 10_000.0
PRESSED_M: Final = 0.03
DARK, LIGHT, RED, GREY = "#12304f", "#7aa6d1", "#8a3324", "#b0bec5"


class Sample(NamedTuple):
    """One cycle: time in s, flange in mm from where it began (base axes), estimated force in N, torque of A2 in Nm."""

    at_s: float
    off_mm: tuple[float, float, float]
    force_n: tuple[float, float, float]
    torque_nm: float


class Arm:
    """A MuJoCo arm under the control stage; ``push`` is what pushes its flange, by where that is off its start."""

    def __init__(self, mode: ControlModeSettings, *, noise: bool = True) -> None:
        description = load_description(ROBOT)
        model = ArmModel(load_pinocchio(ROBOT))
        self._kinematics = model.kinematics(description.limits)
        self._backend = MujocoBackend(description, torque_noise=noise)
        self._backend.open(period_ns=CYCLE_NS)
        self._stage = ControlStage(model.dynamics(NO_LOAD), sensor_sigma_nm=self._backend.capabilities.torque_sigma_nm)
        self._motion = MotionExecutive(description.initial_position_rad, limits=description.limits, cycle_s=1e-3)
        self._motion.control = ControlSetup(mode)
        self._now_ns = 0
        self.set_point = SetPoint(description.initial_position_rad, STILL)
        self.start = self._kinematics.forward(description.initial_position_rad)
        self.wall: Callable[[float], float] | None = None
        """Force along x in N by how far the flange is along it, in m."""

    def change(self, mode: ControlModeSettings) -> None:
        """Let another law take over; a stiff one where the arm is."""
        if isinstance(mode, PositionControlMode):
            self.set_point = SetPoint(self._backend.read().position_rad, STILL)
        self._motion.control = ControlSetup(mode)

    def aim(self, x_m: float) -> None:
        """Put the set point so far along x of the base from the start."""
        there = self.start._replace(x_m=self.start.x_m + x_m)
        self.set_point = SetPoint(self._axes(there), STILL)

    def push(self, force_n: float, seconds: float) -> None:
        """Push the flange along x."""
        self._backend.push(Push(7, (force_n, 0.0, 0.0), (0.0, 0.0, 0.0), seconds))

    def run(self, seconds: float, each: Callable[[float], None] | None = None) -> list[Sample]:
        """Let time pass; ``each`` is told the time of every cycle in s."""
        samples: list[Sample] = []
        for _ in range(round(seconds * 1e9) // CYCLE_NS):
            at_s = self._now_ns * 1e-9
            if each is not None:
                each(at_s)
            arm = self._stage.read(self._backend.read(), now_ns=self._now_ns)
            off_m = tuple(here - there for here, there in zip(self._flange(arm)[:3], self.start[:3], strict=True))
            if self.wall is not None:
                self.push(self.wall(off_m[0]), 1e-3)
            force = self._stage.flange_force(arm, now_ns=self._now_ns).wrench
            self._backend.write(self._stage.command(self.set_point, self._motion, now_ns=self._now_ns))
            self._backend.step()
            torque = -self._backend.read().commanded_torque_nm[1]
            x, y, z = (1e3 * value for value in off_m)
            samples.append(Sample(at_s, (x, y, z), (force[0], force[1], force[2]), torque))
            self._now_ns += CYCLE_NS
        return samples

    def _flange(self, arm: ArmState) -> Pose:
        return self._kinematics.forward(arm.position_rad)

    def _axes(self, pose: Pose) -> Seven:
        found = nearest(self._kinematics, pose, self.set_point.position_rad)
        if not isinstance(found, tuple):
            raise HilError(f"no axis positions lead there: {found}")
        return seven(found)


def step_response(panel: "Axes") -> list[str]:
    """Draw the flange after a step of 5 mm, for three damping ratios."""
    told = []
    for damping, colour in zip(DAMPING, (RED, DARK, LIGHT), strict=True):
        arm = Arm(CartesianImpedanceControlMode(by_translation(2000.0, 200.0), (damping,) * 6))
        arm.run(0.3)
        arm.aim(STEP_M)
        samples = arm.run(1.0)
        far = max(sample.off_mm[0] for sample in samples)
        over = 100.0 * (far / samples[-1].off_mm[0] - 1.0)
        panel.plot(
            [s.at_s - 0.3 for s in samples], [s.off_mm[0] for s in samples], color=colour, label=f"damping {damping:g}"
        )
        told.append(f"step, damping {damping:g}: at rest at {samples[-1].off_mm[0]:.2f} mm, overshoot {over:.0f} %")
    panel.axhline(1e3 * STEP_M, color=GREY, linewidth=0.8)
    panel.set(title="step of the set point, 2000 N/m", xlabel="s", ylabel="flange along x, mm")
    panel.legend(frameon=False)
    return told


def contact(position: "Axes", force: "Axes") -> list[str]:
    """Draw an arm that is led 15 mm into a wall and back."""
    arm = Arm(CartesianImpedanceControlMode(by_translation(1000.0, 200.0)))
    arm.wall = lambda x_m: -WALL_N_M * max(0.0, x_m - WALL_M)
    path_mm: list[float] = []

    def lead(at_s: float) -> None:
        x_m = PRESSED_M * min(1.0, max(0.0, min(at_s, 4.0 - at_s)))
        arm.aim(x_m)
        path_mm.append(1e3 * x_m)

    samples = arm.run(4.5, lead)
    at_s = [sample.at_s for sample in samples]
    truth = [-WALL_N_M * max(0.0, 1e-3 * sample.off_mm[0] - WALL_M) for sample in samples]
    position.plot(at_s, path_mm, color=LIGHT, linewidth=2.0, label="set point")
    position.plot(at_s, [sample.off_mm[0] for sample in samples], color=DARK, label="flange")
    position.axhline(1e3 * WALL_M, color=GREY, linewidth=0.8)
    position.set(title="contact with a wall of 10 N/mm, springs of 1 N/mm", ylabel="along x, mm")
    position.legend(frameon=False)
    force.plot(at_s, truth, color=LIGHT, linewidth=2.0, label="force of the wall")
    force.plot(at_s, [sample.force_n[0] for sample in samples], color=RED, linewidth=0.9, label="estimated")
    force.set(xlabel="s", ylabel="N")
    force.legend(frameon=False)
    pressed = round(2.0e3)
    should = -(PRESSED_M - WALL_M) * 1000.0 * WALL_N_M / (1000.0 + WALL_N_M)
    felt = samples[pressed].force_n[0]
    return [f"contact: the wall pushes with {truth[pressed]:.2f} N (springs: {should:.2f} N), estimated {felt:.2f} N"]


def transition(position: "Axes", torque: "Axes") -> list[str]:
    """Draw Cartesian impedance, pushed, that position control takes over from."""
    arm = Arm(CartesianImpedanceControlMode(by_translation(1000.0, 200.0)))
    arm.push(15.0, 60.0)
    samples = arm.run(1.5)
    arm.change(PositionControlMode())
    samples += arm.run(0.5)
    at_s = [sample.at_s for sample in samples]
    position.plot(at_s, [sample.off_mm[0] for sample in samples], color=DARK)
    position.axvline(1.5, color=GREY, linewidth=0.8)
    position.set(title="15 N; at 1.5 s position control takes over", ylabel="flange along x, mm")
    torque.plot(at_s, [sample.torque_nm for sample in samples], color=RED)
    torque.axvline(1.5, color=GREY, linewidth=0.8)
    torque.set(xlabel="s", ylabel="torque of A2, Nm")
    moved = samples[-1].off_mm[0] - samples[1499].off_mm[0]
    return [f"transition: the flange moves by {moved:+.3f} mm when position control takes over"]


def patterns(panel: "Axes") -> list[str]:
    """Draw what a Lissajous figure and a spiral of force do to the flange, seen along its z."""
    told = []
    for name, mode, colour in (
        ("Lissajous", create_lissajous_pattern(Plane.XY, 0.5, 8.0, 1000.0), DARK),
        ("spiral", create_spiral_pattern(Plane.XY, 0.5, 8.0, 1000.0, 10.0), RED),
    ):
        samples = Arm(mode, noise=False).run(10.0)
        # x of the flange in its start pose points down, all but 10 degrees.
        panel.plot(
            [s.off_mm[1] for s in samples], [s.off_mm[2] for s in samples], color=colour, linewidth=0.9, label=name
        )
        told.append(f"{name}: {max(math.hypot(*s.off_mm[1:]) for s in samples):.1f} mm at most off the start")
    panel.set(
        title="force patterns of 8 N, 1000 N/m", xlabel="flange along y, mm", ylabel="along z, mm", aspect="equal"
    )
    panel.legend(frameon=False)
    return told


def main(folder: Annotated[Path, typer.Option(help="Folder for the pictures.")] = Path("docs")) -> None:
    """Draw the pictures of docs/control.md, and say the figures in them."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    told: list[str] = []
    figure, (step, figures) = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    told += step_response(step) + patterns(figures)
    _finish(figure, (step, figures), folder / "control-step.png")
    figure, panels = plt.subplots(2, 2, figsize=(11, 6), layout="constrained", sharex="col")
    told += contact(panels[0][0], panels[1][0]) + transition(panels[0][1], panels[1][1])
    _finish(figure, panels.flat, folder / "control-contact.png")
    for line in told:
        typer.echo(line)


def _finish(figure: Any, panels: Iterable["Axes"], picture: Path) -> None:
    for panel in panels:
        panel.grid(color="#e6eaef", linewidth=0.8)
        panel.spines[["top", "right"]].set_visible(False)
    figure.savefig(picture, dpi=110)
    from matplotlib import pyplot as plt

    plt.close(figure)


if __name__ == "__main__":
    typer.run(main)
