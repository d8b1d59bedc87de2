"""A servo motion in words, as ``str()`` of its runtime gives it out (manual 7.5.1.3)."""

from collections.abc import Callable, Iterator
from typing import Final

from hil.client.servo._set_point_accounting import accounting_of
from hil.client.servo.session import MotionRecord, Update
from hil.client.servo.statistic_timer import StatisticTimer
from hil.values.operator import OperatorView, ProgramState
from hil.values.pose import Pose
from hil.values.servo import Vector

_WHOLE_PERCENT: Final = 100.0
_PERMISSIVE: Final = "PERMISSIVE: monitors only report"


def describe(
    record: MotionRecord,
    update: Update,
    *,
    verbosity: int,
    timing_update: StatisticTimer,
    timing_set_destination: StatisticTimer,
) -> str:
    """Return the lines of all levels up to ``verbosity``."""
    lines = [
        _headline(record, update),
        f"timing update Controller {timing_update}",
        f"timing SetDestination {timing_set_destination}",
    ]
    for level in range(2, verbosity + 1):
        lines += _FURTHER[level](record, update)
    return "\n".join(lines)


def _headline(record: MotionRecord, update: Update) -> str:
    name = f"{record.kind.manual_name} {record.number}"
    # Said at every level: positions of an arm that nothing would have stopped prove less than they seem to.
    loud = f"; {_PERMISSIVE}" if update.snapshot.operator.permissive else ""
    if record.ended is not None:
        return f"{name} ENDED ({record.ended.end.name}): {record.ended.reason}{loud}"
    motion = update.motion
    state = f"{motion.phase.name}, interpolator {motion.interpolator.name}, remaining {motion.remaining_s:.3f} s"
    return f"{name} {state}{loud}"


def _positions(_: MotionRecord, update: Update) -> Iterator[str]:
    snapshot, motion = update
    yield f"destination {_numbers(motion.destination)} rad, arrived at {_seconds(motion.destination_at_ns)}"
    yield f"set point   {_numbers(snapshot.commanded_position)} rad"
    yield f"measured    {_numbers(snapshot.measured_position)} rad"
    yield f"flange      {_pose(snapshot.flange_in_base)} in the robot base"
    yield (
        f"destinations received {motion.received}, superseded {motion.superseded}, executed {motion.executed}, "
        f"the last at {_seconds(motion.executed_at_ns)}; goals reached {motion.goals_reached}"
    )
    yield f"data of cycle {snapshot.cycle} at {_seconds(snapshot.now_ns)}"


def _everything_else(record: MotionRecord, update: Update) -> Iterator[str]:
    snapshot, session = update.snapshot, record.session
    yield f"set points: {accounting_of(update.motion, sent=record.sent)}"
    yield f"measured torque {_numbers(snapshot.measured_torque)} Nm"
    yield f"external torque {_numbers(snapshot.external_torque)} Nm"
    welcome = session.welcome
    controller = "" if welcome is None else f"{welcome.software}, {welcome.robot}, cycle {welcome.cycle_ms} ms; "
    yield f"controller {controller}{_operator(snapshot.operator)}; commander {snapshot.commander or 'nobody'}"
    yield (
        f"session {session.phase.value}: {session.states} states taken, {session.sent} packets sent, "
        f"{len(session.requests)} requests outstanding, {session.requests.superseded} destinations superseded on the "
        f"way, {session.reports_seen} reports seen, {session.reports_lost} lost; {session.goals_lost} goals not told"
    )
    # Copied first: another thread may be receiving.
    received = ", ".join(f"{count} {outcome.value}" for outcome, count in session.outcomes.copy().items())
    yield f"received {received}"


def _numbers(values: Vector) -> str:
    return f"[{', '.join(f'{value:.6f}' for value in values)}]" if values else "none"


def _pose(pose: Pose) -> str:
    return f"{_numbers(pose.position_m)} m, A B C {_numbers(pose.abc_rad())} rad"


def _seconds(time_ns: int) -> str:
    return f"{time_ns * 1e-9:.3f} s"


def _operator(view: OperatorView) -> str:
    words = f"mode {view.mode.name}"
    if view.program is not ProgramState.RUNNING:
        words += f", program {view.program.name}" + (f" ({view.reason})" if view.reason else "")
    if view.override_percent != _WHOLE_PERCENT:
        words += f", override {view.override_percent:g} %"
    return f"{words}; {_PERMISSIVE}" if view.permissive else words


_FURTHER: Final[dict[int, Callable[[MotionRecord, Update], Iterator[str]]]] = {2: _positions, 3: _everything_else}
VERBOSITY: Final = (1, *_FURTHER)
"""Levels of detail."""
