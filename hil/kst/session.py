"""One KST session, without a socket and without a clock: bytes and times in, replies and jobs for the arm out.

What a published server is silent about for ever is answered with ``nak`` here, told in words and counted; a program
that a published server serves gets the same bytes. :class:`hil.kst.original.OriginalSession` does as the original.
"""

from collections import Counter, deque
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from hil.kst.feedback import numbers
from hil.kst.jobs import Ended, ImpedanceServo, Job, JointMotion, LineMotion, Mode, Motion, Outcome
from hil.kst.log import Log
from hil.kst.phases import PHASES, Event, Phase
from hil.kst.registers import STILL, Registers, pose_of, values_of
from hil.kst.starts import mode_of, motion_of
from hil.values.kst import KstSettings
from hil.values.pose import NOWHERE
from hil.values.robot import JOINT_NAMES
from hil.values.servo import Snapshot, Vector
from transport.kst import (
    DONE,
    INTERRUPTED,
    LINE_MOST_BYTES,
    NAK,
    Command,
    Feedback,
    LineCutter,
    Problem,
    Refused,
    Request,
    Served,
    pin_reply,
    read_request,
    shown,
    values_reply,
)

OPEN_LINE_NS: Final = 1_000_000_000
"""A line that has no end for so long is told."""
FAR_MM: Final = 10_000.0
WAITING_MOST: Final = 8
"""Requests that wait for a real-time mode to end."""
_PIN_IS_HIGH: Final = True
"""As the servers for a flange without connectors have it."""


_SECOND_REPLY: Final = {Outcome.DONE: DONE, Outcome.INTERRUPTED: INTERRUPTED, Outcome.FAILED: NAK}


class _Held(NamedTuple):
    """A reply that has to wait; the arm is free for the next job once it is sent."""

    not_before_ns: int
    reply: bytes


class Arm:
    """What a session tells the arm to do. The shell that owns it calls :meth:`KstSession.ended` in the end."""

    def begin(self, job: Job) -> None:
        """Begin a job; the one before has ended."""
        raise NotImplementedError

    def stop(self) -> None:
        """End the real-time mode that runs."""
        raise NotImplementedError


class KstSession:
    """Serves one client.

    The shell calls :meth:`receive` with what came, :meth:`ended` when a job of the arm has, and then and at
    :attr:`due_ns` sends each of :meth:`replies` in a write of its own. ``state`` returns the controller's latest one.
    """

    def __init__(self, settings: KstSettings, arm: Arm, state: Callable[[], Snapshot]) -> None:
        self.settings = settings
        self.registers = Registers()
        self.phase = Phase.IDLE
        self.over = False
        """Whether the client ended it."""
        self.counters: Counter[str] = Counter()
        self.log = Log()
        self.requests = 0
        """Lines that asked for something: blank ones are none."""
        self.outputs: dict[str, bool] = {}
        """Outputs that were set; nothing is connected to them."""
        self.tcp_in_flange = NOWHERE
        self._arm = arm
        self._state = state
        self._cutter = LineCutter()
        self._open_since_ns: int | None = None
        self._now: list[bytes] = []
        self._held: deque[_Held] = deque()
        self._waiting: deque[Request] = deque()
        self._acknowledged_ns = 0
        """When the job that runs was acknowledged, or its stop."""
        self._impedance = False
        self._mode_ended = ""
        """Why the last real-time mode ended although nobody stopped it."""

    @property
    def due_ns(self) -> int | None:
        """When :meth:`replies` has something although nothing came; None: never."""
        dues = [held.not_before_ns for held in self._held]
        if self._open_since_ns is not None:
            dues.append(self._open_since_ns + OPEN_LINE_NS)
        return min(dues, default=None)

    @property
    def replies_due(self) -> int:
        """Return how many replies :meth:`replies` has at once."""
        return len(self._now)

    @property
    def line_open(self) -> bool:
        """Return whether what came ends within a line."""
        return bool(self._cutter.open_line)

    @property
    def busy(self) -> bool:
        """Whether the arm has a job."""
        return self.phase is not Phase.IDLE

    def receive(self, data: bytes, *, now_ns: int) -> None:
        """Take what the client sent."""
        lines = self._cutter.feed(data)
        for place, line in enumerate(lines):
            if self.over:
                return
            self._take_line(line, last=place == len(lines) - 1, now_ns=now_ns)
        self._open_since_ns = now_ns if self._cutter.open_line else None

    def closed(self) -> None:
        """Nothing more comes; a line that has no end now is refused, and nobody is answered."""
        if self._open_since_ns is not None:
            self._open_since_ns = None
            sentence = f"{self._cutter.open_line[:60]!r} had no line end, a LF, when the client closed the connection"
            self.log.refuse(Problem.NO_END, sentence)

    def ended(self, ended: Ended, *, now_ns: int) -> None:
        """The arm's job has ended."""
        phase = self.phase
        self.counters[f"{phase} {ended.outcome}"] += 1
        if phase is Phase.MOTION:
            if ended.reason:
                self.log.tell(f"the motion {ended.outcome}: {ended.reason}")
            self._held.append(_Held(self._acknowledged_ns + self.settings.motion_gap_ns, _SECOND_REPLY[ended.outcome]))
            return
        if ended.outcome is Outcome.FAILED:
            self._mode_ended = ended.reason
            self.log.tell(f"the real-time mode ended, and set-points move nothing from now on: {ended.reason}")
        if self._impedance and self.settings.second_acknowledgement:
            self._held.append(_Held(self._acknowledged_ns + self.settings.motion_gap_ns, DONE))
            return
        self._free(now_ns)

    def replies(self, *, now_ns: int, all_acknowledged: bool = True) -> list[bytes]:
        """Return the replies that are due, each for a write of its own.

        A reply that must not arrive together with the one before it waits until that was ``all_acknowledged``.
        """
        if self._open_since_ns is not None and now_ns >= self._open_since_ns + OPEN_LINE_NS:
            self._open_since_ns = None
            self.log.refuse(Problem.NO_END, f"{self._cutter.open_line[:60]!r} waits for its line end, a LF, for 1 s")
        due, self._now = self._now, []
        while self._held and now_ns >= self._held[0].not_before_ns and all_acknowledged:
            due.append(self._held.popleft().reply)
            self._free(now_ns)
            due += self._now
            self._now = []
        self.counters["replies"] += len(due)
        return due

    def _take_line(self, line: bytes | None, *, last: bool, now_ns: int) -> None:  # noqa: ARG002  # for the original
        self.counters["lines"] += 1
        if line is None:
            self._refuse(Refused(Problem.TOO_LONG, f"a line has more than {LINE_MOST_BYTES} bytes", ""), now_ns)
            return
        request = read_request(line)
        if request is None:
            return
        self.requests += 1
        if isinstance(request, Refused):
            self._refuse(request, now_ns)
        elif request.spec.served is Served.IDLE and self.busy and request.spec.command in _NEED_THE_ARM:
            self._while_busy(request, now_ns)
        else:
            self._do(request, now_ns)

    def _do(self, request: Request, now_ns: int) -> None:
        if request.spec.command in _HAVE_A_POSE and (far := self._too_far(request.values)):
            self._refuse(Refused(Problem.OUT_OF_RANGE, far, request.text, request.spec), now_ns)
            return
        _HANDLERS[request.spec.command](self, request, now_ns)

    def _while_busy(self, request: Request, now_ns: int) -> None:
        """The arm is not free. What comes while a mode comes to rest waits for that; anything else is refused."""
        if self.phase is Phase.STOPPING and len(self._waiting) < WAITING_MOST:
            self._waiting.append(request)
            return
        sentence = f"{shown(request.text)} while the arm is at something else ({self.phase}); wait for its end"
        self._refuse(Refused(Problem.BUSY, sentence, request.text, request.spec, request.values), now_ns)

    def _refuse(self, refused: Refused, now_ns: int) -> None:  # noqa: ARG002  # for the original
        self.log.refuse(refused.problem, refused.sentence)
        if refused.problem is Problem.TOO_LONG:
            # It may have been any of them.
            for command in _TARGETS:
                self._forget_target(command)
        if refused.spec is not None:
            self._forget_target(refused.spec.command)
            if refused.spec.reply is Feedback.NOTHING:
                return
        self._now.append(NAK)

    def _forget_target(self, command: Command) -> None:
        """A target that was refused is none: no motion may go to the one before instead."""
        registers = self.registers
        if command is Command.SET_JOINTS:
            if self.phase not in _GO_ON_WITH_THE_ONE_BEFORE:
                registers.joints_rad = None
        elif command is Command.SET_POSE:
            registers.pose_values = None
        elif command is Command.SET_CIRCLE_AUXILIARY:
            registers.auxiliary_values = None
        elif command is Command.SET_CIRCLE_END:
            registers.end_values = None
        elif command is Command.SET_SPEED:
            registers.speed = None

    def _free(self, now_ns: int) -> None:
        self._step(Event.ENDED)
        self._impedance = False
        while self._waiting and not self.busy:
            self._do(self._waiting.popleft(), now_ns)

    def _step(self, event: Event) -> None:
        self.phase = PHASES.get((self.phase, event), self.phase)

    # --- always served -----------------------------------------------------------------------------------------

    def _end(self, _request: Request, _now_ns: int) -> None:
        self.over = True

    def _set_output(self, request: Request, _now_ns: int) -> None:
        name = request.spec.token
        on = name.lower().endswith("on")
        self.outputs[name[:-2] if on else name[:-3]] = on
        self._now.append(DONE)

    def _read_input(self, _request: Request, _now_ns: int) -> None:
        self._now.append(pin_reply(_PIN_IS_HIGH))

    def _query(self, request: Request, _now_ns: int) -> None:
        self.counters["queries"] += 1
        self._answer(request.spec.reply)

    def _set_joints(self, request: Request, now_ns: int) -> None:
        if outside := self._outside(request.values):
            self._refuse(Refused(Problem.OUT_OF_RANGE, outside, request.text, request.spec), now_ns)
            return
        self.registers.joints_rad = request.values
        self._set_point_taken()
        self._answer(request.spec.reply)

    def _set_velocities(self, request: Request, now_ns: int) -> None:
        if too_fast := self._too_fast(request.values):
            self._refuse(Refused(Problem.OUT_OF_RANGE, too_fast, request.text, request.spec), now_ns)
            return
        self.registers.velocity_rad_s, self.registers.velocity_at_ns = request.values, now_ns
        self._set_point_taken()
        self._answer(request.spec.reply)

    def _set_servo_pose(self, request: Request, _now_ns: int) -> None:
        self.registers.servo_pose = request.values
        self._set_point_taken()
        self._answer(request.spec.reply)

    def _set_pose(self, request: Request, _now_ns: int) -> None:
        self.registers.pose_values = request.values
        self._now.append(DONE)

    def _set_auxiliary(self, request: Request, _now_ns: int) -> None:
        self.registers.auxiliary_values = request.values
        self._now.append(DONE)

    def _set_circle_end(self, request: Request, _now_ns: int) -> None:
        self.registers.end_values = request.values
        self._now.append(DONE)

    def _stop_servo(self, _request: Request, now_ns: int) -> None:
        # A stop holds for what was asked for before it, also for what has not begun.
        waiting, self._waiting = self._waiting, deque()
        for request in waiting:
            sentence = f"{shown(request.text)} was stopped before it could begin"
            self._refuse(Refused(Problem.BUSY, sentence, request.text, request.spec, request.values), now_ns)
        self._now.append(DONE)
        if (self.phase, Event.STOP_ASKED) in PHASES:
            self._step(Event.STOP_ASKED)
            self._acknowledged_ns = now_ns
            self._arm.stop()

    def _set_point_taken(self) -> None:
        self.counters["set_points"] += 1
        self.registers.set_points += 1
        if self._mode_ended and not self.busy:
            self.counters["set_points_after_a_failed_mode"] += 1

    def _answer(self, feedback: Feedback) -> None:
        if feedback is Feedback.DONE:
            self._now.append(DONE)
        elif feedback is not Feedback.NOTHING:
            self._now.append(values_reply(numbers(feedback, self._state(), self.tcp_in_flange)))

    def _outside(self, position_rad: Vector) -> str:
        """Return which axis has no such position, or an empty text."""
        ranges = zip(self.settings.position_min_rad, self.settings.position_max_rad, strict=True)
        for axis, (position, (least, most)) in enumerate(zip(position_rad, ranges, strict=True)):
            if not least <= position <= most:
                return f"{JOINT_NAMES[axis]} at {position:.6g} rad is outside its range {least:.4f}..{most:.4f} rad"
        return ""

    def _too_fast(self, velocity_rad_s: Vector) -> str:
        """Return which axis cannot be so fast, or an empty text."""
        for axis, (velocity, most) in enumerate(zip(velocity_rad_s, self.settings.velocity_max_rad_s, strict=True)):
            if abs(velocity) > most:
                return f"{JOINT_NAMES[axis]} at {velocity:.6g} rad/s is faster than its {most:.4f} rad/s"
        return ""

    def _too_far(self, pose_values: Vector) -> str:
        """Return which coordinate no arm reaches, or an empty text."""
        for name, value in zip("xyz", pose_values, strict=False):
            if abs(value) > FAR_MM:
                return f"{name} at {value:g} mm is beyond the reach of any arm; {FAR_MM:g} mm are allowed"
        return ""

    # --- served when the arm is free ----------------------------------------------------------------------------

    def _attach_tool(self, request: Request, _now_ns: int) -> None:
        self.tcp_in_flange = pose_of(request.values)
        self._now.append(DONE)

    def _set_speed(self, request: Request, now_ns: int) -> None:
        speed = request.values[0]
        if speed <= 0.0:
            sentence = f"the speed is {speed:g}; above 0 is needed: up to 1 for joint motions, mm/s for the others"
            self._refuse(Refused(Problem.OUT_OF_RANGE, sentence, request.text, request.spec), now_ns)
            return
        self.registers.speed = speed
        self._now.append(DONE)

    def _hand_guiding(self, request: Request, _now_ns: int) -> None:
        sentence = (
            f"{shown(request.text)}: nobody guides an emulated arm by hand; acknowledged at once, nothing is done"
        )
        self.log.note("hand guiding", sentence)
        self._now.append(DONE)

    def _start_motion(self, request: Request, now_ns: int) -> None:
        motion = self._motion_of(request)
        self._acknowledge(Event.MOTION_STARTED, now_ns)
        if isinstance(motion, str):
            # As a controller does that rejects a motion: its start is acknowledged, and its end is a nak.
            self.log.refuse(Problem.NOT_POSSIBLE, motion)
            self.ended(Ended(Outcome.FAILED), now_ns=now_ns)
        elif isinstance(motion, JointMotion | LineMotion) and motion.conditional and not motion.conditions:
            sentence = f"{shown(request.text)} has no conditions: acknowledged twice, and nothing moves"
            self.log.note("no conditions", sentence)
            self.ended(Ended(Outcome.DONE), now_ns=now_ns)
        else:
            self._arm.begin(motion)

    def _motion_of(self, request: Request) -> Motion | str:
        return motion_of(request, self.registers, self.tcp_in_flange)

    def _start_mode(self, request: Request, now_ns: int) -> None:
        mode = mode_of(request, self.tcp_in_flange)
        self._mode_ended = ""
        self._preset(mode, self._state(), now_ns)
        self._impedance = isinstance(mode, ImpedanceServo)
        self._acknowledge(Event.IMPEDANCE_STARTED if self._impedance else Event.SERVO_STARTED, now_ns)
        self._arm.begin(mode)

    def _preset(self, mode: Mode, state: Snapshot, now_ns: int) -> None:  # noqa: ARG002  # for the original
        """Set the set-points to where the arm is: a mode that begins moves nothing."""
        registers = self.registers
        registers.joints_rad = state.measured_position
        registers.servo_pose = values_of(state.flange_in_base @ self.tcp_in_flange)
        registers.velocity_rad_s, registers.velocity_at_ns = STILL, now_ns

    def _acknowledge(self, event: Event, now_ns: int) -> None:
        self._step(event)
        self._acknowledged_ns = now_ns
        self._now.append(DONE)


_HANDLERS: Final[Mapping[Command, Callable[[KstSession, Request, int], None]]] = {
    Command.END: KstSession._end,
    Command.ATTACH_TOOL: KstSession._attach_tool,
    Command.QUERY: KstSession._query,
    Command.READ_INPUT: KstSession._read_input,
    Command.SET_OUTPUT: KstSession._set_output,
    Command.SET_JOINTS: KstSession._set_joints,
    Command.SET_VELOCITIES: KstSession._set_velocities,
    Command.SET_SERVO_POSE: KstSession._set_servo_pose,
    Command.SET_POSE: KstSession._set_pose,
    Command.SET_CIRCLE_AUXILIARY: KstSession._set_auxiliary,
    Command.SET_CIRCLE_END: KstSession._set_circle_end,
    Command.SET_SPEED: KstSession._set_speed,
    Command.MOVE_JOINTS: KstSession._start_motion,
    Command.MOVE_LINE: KstSession._start_motion,
    Command.MOVE_LINE_IN_BASE: KstSession._start_motion,
    Command.MOVE_LINE_IN_TOOL: KstSession._start_motion,
    Command.MOVE_CIRCLE: KstSession._start_motion,
    Command.MOVE_JOINTS_UNTIL: KstSession._start_motion,
    Command.MOVE_LINE_UNTIL: KstSession._start_motion,
    Command.MOVE_CIRCLE_UNTIL: KstSession._start_motion,
    Command.START_JOINT_SERVO: KstSession._start_mode,
    Command.START_CARTESIAN_SERVO: KstSession._start_mode,
    Command.START_VELOCITY_SERVO: KstSession._start_mode,
    Command.START_IMPEDANCE: KstSession._start_mode,
    Command.STOP_SERVO: KstSession._stop_servo,
    Command.HAND_GUIDING: KstSession._hand_guiding,
}

_HAVE_A_POSE: Final = frozenset(
    {
        Command.ATTACH_TOOL,
        Command.SET_POSE,
        Command.SET_CIRCLE_AUXILIARY,
        Command.SET_CIRCLE_END,
        Command.SET_SERVO_POSE,
    }
)
_TARGETS: Final = (
    Command.SET_JOINTS,
    Command.SET_POSE,
    Command.SET_CIRCLE_AUXILIARY,
    Command.SET_CIRCLE_END,
    Command.SET_SPEED,
)
_GO_ON_WITH_THE_ONE_BEFORE: Final = frozenset({Phase.SERVO, Phase.IMPEDANCE})
"""Real-time modes outlive a wrong set-point; a motion that runs has its target already."""
_NEED_THE_ARM: Final = frozenset(Command) - {Command.QUERY, Command.SET_SPEED, Command.HAND_GUIDING}
"""Of the commands that are served when the arm is free, those that truly need it; the others are served always."""
