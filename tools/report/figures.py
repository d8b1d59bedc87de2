"""The key figures of a robot, in words."""

from collections.abc import Mapping

from hil.config.station import RobotConfig
from tools.report.packets import PacketObserver
from tools.report.record import RobotRecord
from tools.report.tables import mapping


def figures_of(robot: RobotRecord, config: RobotConfig) -> list[tuple[str, str]]:
    """Return those of a replayed robot; its record is finished."""
    report = robot.report
    closest = str(report.get("closest") or "").removeprefix("closest to ")
    permissive = ", PERMISSIVE" if config.permissive else ""
    return [
        ("recorded", f"{robot.end_s:.3f} s, {report.get('ticks')} cycles of {config.cycle_ms} ms"),
        ("robot side and mode", f"{config.backend}, {config.mode.value}{permissive}"),
        *_fri(robot, config),
        *_servo(report),
        ("stops", f"{robot.stop_count}" if robot.stop_count else "none"),
        _speed(robot),
        ("closest margin", closest or "nothing used"),
    ]


def _fri(robot: RobotRecord, config: RobotConfig) -> list[tuple[str, str]]:
    if config.fri is None:
        return []
    session, packets = mapping(robot.report.get("session")), mapping(robot.report.get("packets"))
    sent, received, accepted = (packets.get(name) for name in ("sent", "received", "accepted"))
    return [
        ("FRI", f"release {config.fri.release}, {robot.budget_ms:g} ms for an answer, overlay {config.fri.overlay}"),
        ("session at the end", f"{session.get('state')} after {session.get('changes')} changes"),
        *_latency(robot),
        ("FRI packets", f"{sent} sent, {received} received, {accepted} accepted"),
    ]


def _servo(report: Mapping[str, object]) -> list[tuple[str, str]]:
    servo = mapping(report.get("servo"))
    if not servo:
        return []
    return [
        ("sessions and motions", f"{servo.get('sessions_begun')} and {servo.get('motions_begun')} on the servo link"),
        ("requests", f"{servo.get('requests_taken')} taken, {servo.get('requests_refused')} refused"),
    ]


def figures_from_packets(observer: PacketObserver) -> list[tuple[str, str]]:
    """Return those of a robot of which only packets are known."""
    robot = observer.record
    told = robot.configuration
    period_ms, multiplier = told["send period [ms]"], told["receive multiplier"]
    return [
        ("recorded", f"{robot.end_s:.3f} s"),
        ("controller and client", f"{told['controller']}, {told['client']}"),
        ("FRI", f"release {told['release']}, {period_ms} ms x {multiplier} for an answer"),
        ("messages", f"{observer.messages} of the controller, {observer.answers} of the client"),
        *_latency(robot),
        ("safety stops", f"{robot.stop_count}" if robot.stop_count else "none"),
        ("quality fell below GOOD", _times(len(robot.quality_falls))),
        _speed(robot),
    ]


def _latency(robot: RobotRecord) -> list[tuple[str, str]]:
    times = robot.latencies
    if not times.count:
        return [("answers", "none")]
    late = f"{times.late} of {times.count} later than {robot.budget_ms:g} ms"
    half_ms, most_ms = times.quantile_ms(0.5), times.quantile_ms(0.99)
    told = f"median {half_ms:.3g} ms, 99 % within {most_ms:.3g} ms, largest {times.largest_ms:.3g} ms"
    return [("answers", late if times.late else f"{times.count}, all in time"), ("answer latency", told)]


def _speed(robot: RobotRecord) -> tuple[str, str]:
    if not robot.largest_speed_mm_s:
        return "largest flange speed", "it did not move"
    return "largest flange speed", f"{robot.largest_speed_mm_s:.1f} mm/s at {robot.largest_speed_at_s:.3f} s"


def _times(count: int) -> str:
    return ("never", "once")[count] if count < 2 else f"{count} times"
