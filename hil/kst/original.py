"""A session as a published server has it, its faults included (``--kst-strict``).

What it reproduces: silence for what it does not know and for what comes while it moves; one slot for the commands its
main loop serves, which the next line overwrites; a reader that a wrong number kills, a real-time mode that one ends,
and seconds of stall for a value too many; a conditional circle that is a joint motion, and a conditional relative line
that is an absolute one; an attached tool forgotten after an error; the end of the server when a
session ends, and none at all when a client vanishes. What it does not: the race that loses a command within 0.1 ms of
a reply.
"""

from typing import Final

from hil.kst.jobs import Ended, ImpedanceServo, Mode, Motion, Outcome
from hil.kst.phases import PHASES, Event, Phase
from hil.kst.registers import STILL
from hil.kst.session import KstSession
from hil.values.errors import ConfigurationError
from hil.values.pose import NOWHERE
from hil.values.servo import Snapshot, Vector
from transport.kst import NAK, Command, Problem, Refused, Request, Served, Spec, shown

STALL_NS: Final = 5_400_000_000
"""What a value too many costs; measured on a published server, with the faster of two compilers."""
STALLED_MOST_BYTES: Final = 1 << 16
"""What is kept of what comes during a stall."""


class OriginalSession(KstSession):
    """See the module."""

    deaf = False
    """Whether the reader is dead: nothing is answered any more, not even ``end``."""
    _last = True
    """Whether no other line came with the one that is looked at."""
    _deferred: Request | None = None
    _defers = False
    """Whether the motion that runs is a conditional one, after which the last command that came is done."""
    _stalled: bytes = b""
    _stalled_until_ns: int | None = None

    @property
    def due_ns(self) -> int | None:
        """When :meth:`replies` has something although nothing came; None: never."""
        return super().due_ns if self._stalled_until_ns is None else self._stalled_until_ns

    def receive(self, data: bytes, *, now_ns: int) -> None:
        """Take what the client sent."""
        if self._stalled_until_ns is not None and now_ns < self._stalled_until_ns:
            self._stalled = (self._stalled + data)[:STALLED_MOST_BYTES]
        elif not self.deaf:
            super().receive(data, now_ns=now_ns)

    def replies(self, *, now_ns: int, all_acknowledged: bool = True) -> list[bytes]:
        """Return the replies that are due, each for a write of its own."""
        if self._stalled_until_ns is not None:
            if now_ns < self._stalled_until_ns:
                return []
            waiting, self._stalled, self._stalled_until_ns = self._stalled, b"", None
            self.receive(waiting, now_ns=now_ns)
        return super().replies(now_ns=now_ns, all_acknowledged=all_acknowledged)

    def ended(self, ended: Ended, *, now_ns: int) -> None:
        """The arm's job has ended."""
        if ended.outcome is Outcome.FAILED:
            self.tcp_in_flange = NOWHERE
        super().ended(ended, now_ns=now_ns)

    def _take_line(self, line: bytes | None, *, last: bool, now_ns: int) -> None:
        self._last = last
        if not self.deaf:
            super()._take_line(line, last=last, now_ns=now_ns)

    def _do(self, request: Request, now_ns: int) -> None:
        spec = request.spec
        if not spec.published:
            self.log.refuse(Problem.UNKNOWN, f"a published server does not know {spec.token!r}, and is silent")
        elif spec.served is Served.IDLE and not self._last:
            self.log.refuse(Problem.BUSY, f"{shown(request.text)} was overwritten by the line that came with it: lost")
        elif spec.served is Served.IDLE and self.busy:
            self._while_busy(request, now_ns)
        else:
            if spec.command in _STARTS:
                self._defers = spec.command in _CONDITIONAL
            super()._do(request, now_ns)

    def _while_busy(self, request: Request, now_ns: int) -> None:  # noqa: ARG002  # its parent's
        if self._defers and self.phase is Phase.MOTION:
            self._deferred = request
        else:
            self.log.refuse(
                Problem.BUSY, f"{shown(request.text)} while the arm is at something else ({self.phase}): lost"
            )

    def _free(self, now_ns: int) -> None:
        super()._free(now_ns)
        deferred, self._deferred = self._deferred, None
        if deferred is not None:
            self._last = True
            self._do(deferred, now_ns)

    def _outside(self, position_rad: Vector) -> str:  # noqa: ARG002  # the controller judges
        return ""

    def _too_far(self, pose_values: Vector) -> str:  # noqa: ARG002  # the controller judges
        return ""

    def _too_fast(self, velocity_rad_s: Vector) -> str:  # noqa: ARG002  # the controller judges
        return ""

    def _motion_of(self, request: Request) -> Motion | str:
        if request.spec.command is Command.MOVE_CIRCLE_UNTIL:
            # It mixes them up.
            spec = request.spec._replace(command=Command.MOVE_JOINTS_UNTIL)
            request = request._replace(spec=spec)
        elif request.spec.command is Command.MOVE_LINE_UNTIL:
            request = request._replace(text=request.spec.token)
        try:
            return super()._motion_of(request)
        except ConfigurationError as error:
            # A register that took Infinity; a controller rejects such a motion.
            return str(error)

    def _preset(self, mode: Mode, state: Snapshot, now_ns: int) -> None:
        kept = self.registers.joints_rad or STILL
        super()._preset(mode, state, now_ns)
        if isinstance(mode, ImpedanceServo):
            # It forgets the first axis.
            self.registers.joints_rad = (kept[0], *state.measured_position[1:])

    def _refuse(self, refused: Refused, now_ns: int) -> None:
        self.log.refuse(refused.problem, refused.sentence)
        spec = refused.spec
        if spec is None or refused.problem is Problem.NOT_TEXT:
            return
        if spec.command in _REGISTERS:
            self._store_wrong(refused, spec, now_ns)
        elif spec.command is Command.START_IMPEDANCE and refused.problem is not Problem.NO_NUMBER:
            values = (*refused.values, *STILL)[: len(STILL)]
            self._do(Request(spec, values, refused.text), now_ns)
        else:
            self.tcp_in_flange = NOWHERE
            self._now.append(NAK)
            if spec.command is Command.ATTACH_TOOL and refused.problem is Problem.TOO_FEW:
                self.over = True

    def _store_wrong(self, refused: Refused, spec: Spec, now_ns: int) -> None:
        register, size = _REGISTERS[spec.command]
        before: Vector = getattr(self.registers, register) or STILL
        values = refused.values[:size]
        setattr(self.registers, register, (*values, *before[len(values) : size]))
        if spec.command in _TOLERANT:
            if refused.problem in (Problem.NO_NUMBER, Problem.TOO_MANY) and (self.phase, Event.STOP_ASKED) in PHASES:
                self._arm.stop()
            if refused.problem is Problem.TOO_MANY:
                self._stalled_until_ns = now_ns + STALL_NS
        elif refused.problem is Problem.NO_NUMBER:
            self.deaf = True
            self.log.tell("the reader of a published server is dead now: nothing is answered any more")
            return
        self._answer(spec.reply)


_CONDITIONAL: Final = frozenset({Command.MOVE_JOINTS_UNTIL, Command.MOVE_LINE_UNTIL, Command.MOVE_CIRCLE_UNTIL})
_STARTS: Final = _CONDITIONAL | {
    Command.MOVE_JOINTS,
    Command.MOVE_LINE,
    Command.MOVE_LINE_IN_BASE,
    Command.MOVE_LINE_IN_TOOL,
    Command.MOVE_CIRCLE,
}
_TOLERANT: Final = frozenset({Command.SET_SERVO_POSE, Command.SET_VELOCITIES})
"""Set-points whose parser outlives a wrong number; the real-time mode does not."""
_REGISTERS: Final = {
    Command.SET_JOINTS: ("joints_rad", 7),
    Command.SET_POSE: ("pose_values", 6),
    Command.SET_CIRCLE_AUXILIARY: ("auxiliary_values", 6),
    Command.SET_CIRCLE_END: ("end_values", 6),
    Command.SET_SERVO_POSE: ("servo_pose", 6),
    Command.SET_VELOCITIES: ("velocity_rad_s", 7),
}
