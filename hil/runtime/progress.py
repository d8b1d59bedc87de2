"""One line about a running robot, for the terminal."""

from hil.runtime.robot_process import RobotProcess
from hil.values.fri import OperationMode
from hil.values.operator import OperatorView, ProgramState


def progress_line(robot: RobotProcess, *, elapsed_s: float, duration_s: float | None) -> str:
    """Return time, operator, session, quality, rate, lateness, missed cycles, packets, closest margin in one line."""
    measured, controller = robot.measurements, robot.controller
    time_text = f"{elapsed_s:7.1f} s" if duration_s is None else f"{elapsed_s:5.1f} of {duration_s:g} s"
    late_ns = measured.lateness.quantile(0.99)
    parts = [
        time_text,
        robot.config.name,
        f"{measured.rate_hz or 0:.1f} Hz",
        f"late p99 {0 if late_ns is None else late_ns / 1000:.0f} us",
        f"missed {measured.missed_cycles}",
    ]
    fri = controller.fri
    if fri is not None:
        counters = fri.counters
        dropped = counters.received - counters.accepted_count
        parts[2:2] = [f"{fri.state.name} {fri.quality.name}"]
        parts.append(f"sent {counters.sent}, accepted {counters.accepted_count}, dropped {dropped}")
    parts[2:2] = _operator(controller.operator)
    if controller.servo is not None and controller.servo.commander:
        parts.append(f"commanded by {controller.servo.commander}")
    if closest := controller.closest:
        parts.append(closest.partition(" at ")[0])
    return " | ".join(parts)


def _operator(view: OperatorView) -> list[str]:
    """Return what is not as in an ordinary run."""
    parts = ["PERMISSIVE"] if view.permissive else []
    if view.mode is not OperationMode.AUT:
        parts.append(view.mode.name)
    if view.program is not ProgramState.RUNNING:
        parts.append(view.program.name)
    return parts
