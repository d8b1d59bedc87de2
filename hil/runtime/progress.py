"""One line about a running robot, for the terminal."""

from hil.runtime.robot_process import RobotProcess


def progress_line(robot: RobotProcess, *, elapsed_s: float, duration_s: float | None) -> str:
    """Return time, session, quality, rate and lateness, missed cycles and packets in one line."""
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
    if controller.servo is not None and controller.servo.commander:
        parts.append(f"commanded by {controller.servo.commander}")
    return " | ".join(parts)
