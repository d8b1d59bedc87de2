"""Plays one scenario in virtual time, in the calling thread, and says what became of it.

The same scenario gives the same row on every machine, but for ``wall_s`` and ``attempts``: time is virtual, and the
seed is that of the network, the sensors and the module ``random``. What a program keeps in modules that it imports
stays for the next scenario of the same worker.
"""

import random
import runpy
import sys
import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from io import TextIOBase
from pathlib import Path
from typing import Any, Final

from hil.clock import elapsed_ns
from hil.config.station import RobotConfig, parse_robot
from hil.core.events import ArmStopped, Event, MotionBegan, MotionOver, StateChanged
from hil.core.safety.margins import MonitorName
from hil.replay.conversations import fri_conversation, servo_conversation
from hil.replay.replay import Wish
from hil.runtime.assembly import make_servo_codec
from hil.testkit.controller import VirtualController
from hil.testkit.errors import NeverHappened, VirtualTimeOver
from hil.values.errors import HilError, UsageError
from hil.values.fri import SessionState
from hil.values.outcomes import Outcome
from hil.values.robot import Seven
from tools.campaign.requirement import broken
from tools.campaign.scenario import Row, Scenario, empty_row
from transport.impairment import parse_fault

_LINES_KEPT: Final = 20
_LONGEST_LINE: Final = 500
_BOX: Final = "│ "
_FIRST_POSTURE_S: Final = 0.01
_REFUSED_FOR: Final = {
    Outcome.AXIS_LIMIT: "axis range (refused)",
    Outcome.AXIS_VELOCITY: "axis velocity (refused)",
    Outcome.TORQUE_LIMIT: "axis torque (refused)",
}
_ONE_AT_A_TIME: Final = threading.Lock()
"""Virtual time is of a whole process: a worker with several threads plays one scenario after the other."""


def play(
    scenario: Scenario,
    *,
    capture: Path | None = None,
    say: Callable[[str], None] | None = None,
    events: Callable[[str], None] | None = None,
) -> Row:
    """Play ``scenario``; every end of it is a row. ``say`` gets what the program prints, ``events`` what happened."""
    began_ns = elapsed_ns()
    with _ONE_AT_A_TIME:
        try:
            config = parse_robot(dict(scenario.robot), where=scenario.name)
            config = config.model_copy(update={"seed": scenario.seed})
            controller = VirtualController(
                config,
                limit_s=scenario.seconds,
                capture=capture,
                initial_position_rad=_recorded_start(scenario, config),
            )
        except (HilError, OSError) as error:
            return empty_row(scenario, "refused", str(error))
        with controller.active():
            reason = _spoken(scenario, controller, say)
            row = _row(scenario, controller, reason)
            if events is not None:
                for line in controller.told():
                    events(line)
    row["wall_s"] = round((elapsed_ns() - began_ns) * 1e-9, 4)
    return row


def _spoken(scenario: Scenario, controller: VirtualController, say: Callable[[str], None] | None) -> str:
    """Let the application run to its end; return what went wrong with it, or an empty text."""
    random.seed(scenario.seed)
    if scenario.faults:
        controller.network.arm(*map(parse_fault, scenario.faults), seed=scenario.seed)
    if scenario.capture is not None:
        return _recorded(Path(scenario.capture), controller, scenario.seconds)
    assert scenario.run is not None  # noqa: S101  # a plan has no others
    return _program(scenario.run, scenario.arguments, say)


def _program(run: str, arguments: tuple[str, ...], say: Callable[[str], None] | None) -> str:
    """Run a program as ``python -m`` or ``python file.py`` would, in this process."""
    output = _Tail(say)
    with _program_of(run, arguments), redirect_stdout(output), redirect_stderr(output):
        try:
            if run.endswith(".py"):
                runpy.run_path(run, run_name="__main__")
            else:
                runpy.run_module(run, run_name="__main__", alter_sys=True)
        except SystemExit as end:
            if end.code in {None, 0}:
                return ""
            code = end.code if isinstance(end.code, int) else 1
            last = one_line(end.code) if isinstance(end.code, str) else output.last
            return f"exit code {code}{f': {last}' if last else ''}"
        except VirtualTimeOver:
            return ""
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001  # whatever ends a program is an end of the program
            output.write("".join(traceback.format_exception(error)))
            return one_line(f"{type(error).__name__}: {error}") + _raised_at(error)
    return ""


def _raised_at(error: BaseException) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    return f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""


def one_line(text: str) -> str:
    """Return ``text`` as a table and a terminal can show it: on one line, not too long, without control characters."""
    return " ".join("".join(sign if sign.isprintable() else " " for sign in text[:_LONGEST_LINE]).split())


@contextmanager
def _program_of(run: str, arguments: tuple[str, ...]) -> Iterator[None]:
    """Let the interpreter look as it does to a program that was started with ``arguments``."""
    before = sys.argv, list(sys.path)
    sys.argv = [run, *arguments]
    sys.path.insert(0, str(Path(run).parent) if run.endswith(".py") else str(Path.cwd()))
    try:
        yield
    finally:
        sys.argv, sys.path[:] = before


def _recorded(capture: Path, controller: VirtualController, seconds: float) -> str:
    """Let the clients of a capture speak again, as far as this controller has their links."""
    over: list[Callable[[], bool]] = []
    missing: list[str] = []
    if controller.config.fri is not None:
        try:
            client = controller.attach_recorded_client(capture).session
            over.append(lambda: client.ended)
        except UsageError as error:
            missing.append(str(error))
    if controller.config.servo is not None:
        try:
            application = controller.attach_recorded_application(capture).session
            over.append(lambda: application.over)
        except UsageError as error:
            missing.append(str(error))
    if not over:
        return "; ".join(missing)
    # Not a moment longer: an FRI client that has said its last is missed within its watchdog's time.
    with suppress(NeverHappened, VirtualTimeOver):
        controller.run_until(lambda: all(ended() for ended in over), at_most_s=seconds)
    return ""


def _recorded_start(scenario: Scenario, config: RobotConfig) -> Seven | None:
    """Return where the recorded arm was when its recording began; None: where the model says."""
    if scenario.capture is None:
        return None
    capture = Path(scenario.capture)
    if config.fri is not None:
        try:
            return fri_conversation(capture, Wish(config.fri.release)).initial_position_rad
        except UsageError:
            if config.servo is None:
                raise
    if config.servo is not None:
        servo_conversation(capture, make_servo_codec(config.servo))
    return None


def _row(scenario: Scenario, controller: VirtualController, reason: str) -> Row:
    row = empty_row(scenario, "passed", "")
    report, events = controller.report(), list(controller.events)
    row["virtual_s"] = round(controller.now_s, 6)
    stops = [event for event in events if isinstance(event, ArmStopped)]
    row["stops"] = len(stops)
    if stops:
        row["first_stop_s"], row["first_stop"] = round(stops[0].at_ns * 1e-9, 6), str(stops[0])
    row["commanded_s"] = round(_commanded_ns(events, round(controller.now_s * 1e9)) * 1e-9, 6)
    _note_margins(row, report["margins"])
    _note_refusals(row, report["packets"])
    _note_answers(row, report)
    servo = report["servo"]
    if servo is not None:
        row["destinations_asked"] = sum(motion["received"] for motion in servo["motions"])
        row["destinations_executed"] = sum(motion["executed"] for motion in servo["motions"])
    packets = {str(direction): count for direction, count in controller.network.packets.items()}
    row["packets_to_controller"], row["packets_to_peer"] = packets["to-controller"], packets["to-peer"]
    row["faults_fired"] = sum(fault.fired for fault in controller.network.reports())
    if scenario.capture is None and controller.now_s >= scenario.seconds:
        # Also where it said something of its own about the end of time.
        row["outcome"], row["reason"] = "timeout", f"the application did not end within {scenario.seconds:g} s"
    elif reason:
        row["outcome"], row["reason"] = "failed", reason
    refused = report["session"]["refused"] if report["session"] is not None else ()
    told = broken(
        scenario.require, row, refusal=f"{refused[-1]['reason']} (said at {refused[-1]['at_s']:g} s)" if refused else ""
    )
    if told:
        row["reason"] = "; ".join(filter(None, (row["reason"], told)))
        if row["outcome"] == "passed":
            row["outcome"] = "failed"
    return row


def _note_margins(row: Row, margins: dict[str, dict[str, Any]]) -> None:
    row["axis_range_used"] = margins[MonitorName.AXIS_RANGE]["used"]
    row["axis_velocity_used"] = margins[MonitorName.AXIS_VELOCITY]["used"]
    row["axis_torque_used"] = margins[MonitorName.AXIS_TORQUE]["used"]
    row["tracking_used"] = margins[MonitorName.TRACKING]["used"]
    row["t1_speed_used"] = max(margins[name]["used"] for name in (MonitorName.COMMANDED_T1, MonitorName.MEASURED_T1))
    # Where the arm stood and what it weighed in its first cycles says nothing of the scenario.
    used = {name: margin for name, margin in margins.items() if margin["at_s"] > _FIRST_POSTURE_S}
    if used:
        name, margin = max(used.items(), key=lambda entry: float(entry[1]["used"]))
        row["margin_used"], row["margin_monitor"] = margin["used"], name
        row["margin_axis"], row["margin_at_s"] = margin["axis"] or "", margin["at_s"]


def _note_refusals(row: Row, packets: dict[str, Any] | None) -> None:
    """A command that was refused for a limit never reached the arm, so no monitor has a figure of it."""
    refused_for = [name for outcome, name in _REFUSED_FOR.items() if packets and packets["dropped"][outcome]]
    if refused_for and row["margin_used"] < 1.0:
        row["margin_used"], row["margin_monitor"], row["margin_axis"], row["margin_at_s"] = 1.0, refused_for[0], "", 0.0


def _note_answers(row: Row, report: dict[str, Any]) -> None:
    latency, packets, session = report["answer_latency_us"], report["packets"], report["session"]
    if packets is None:
        return
    row["messages"], row["answers"], row["quality"] = packets["sent"], packets["received"], session["quality"]
    row["late_answers"] = packets["dropped"]["late"]
    row["dropped_answers"] = sum(packets["dropped"].values())
    if latency is not None and packets["received"]:
        row["answer_latency_p50_us"] = latency["p50"]
        row["answer_latency_p99_us"], row["answer_latency_max_us"] = latency["p99"], latency["max"]


def _commanded_ns(events: list[Event], now_ns: int) -> int:
    """Return for how long the arm was commanded: by an FRI client in COMMANDING_ACTIVE, or by a servo motion."""
    total_ns, since_ns = 0, None
    for event in events:
        begins = isinstance(event, MotionBegan) or (
            isinstance(event, StateChanged) and event.new is SessionState.COMMANDING_ACTIVE
        )
        ends = isinstance(event, MotionOver) or (
            isinstance(event, StateChanged) and event.old is SessionState.COMMANDING_ACTIVE
        )
        if begins and since_ns is None:
            since_ns = event.at_ns
        elif ends and since_ns is not None:
            total_ns, since_ns = total_ns + event.at_ns - since_ns, None
    return total_ns + (0 if since_ns is None else now_ns - since_ns)


class _Tail(TextIOBase):
    """Keeps the last lines of what a program prints, and hands all of them on."""

    def __init__(self, say: Callable[[str], None] | None) -> None:
        super().__init__()
        self._say = say
        self._lines: deque[str] = deque(maxlen=_LINES_KEPT)
        self._open = ""
        self._before = sys.stdout, sys.stderr

    @property
    def last(self) -> str:
        """The last line that says something; that of a box of typer's is inside it."""
        lines = map(one_line, reversed([*self._lines, self._open]))
        return next((line.strip(_BOX) for line in lines if any(map(str.isalnum, line))), "")

    def writable(self) -> bool:
        """Whether it can be written to."""
        return True

    def write(self, text: str, /) -> int:
        """Take what is printed."""
        *whole, self._open = (self._open + text).split("\n")
        self._open = self._open[-_LONGEST_LINE:]
        for line in whole:
            self._lines.append(line[:_LONGEST_LINE])
            if self._say is not None:
                out, err = self._before
                with redirect_stdout(out), redirect_stderr(err):
                    self._say(line)
        return len(text)
