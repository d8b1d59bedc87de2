"""A stand-in for the controller's end of the servo link: sans-I/O, a few rules, driven tick by tick by tests.

It keeps the protocol of :mod:`hil.values.servo` to the letter and knows nothing of motion: a destination is reached a
few ticks after it came, a PTP ends there, a servo motion rests for its timeout. While it is paused nothing moves, and
destinations of motions that wait for pause are not done yet, nor is what was asked after them.

Its arm is no arm: A1, A2, A3 are x, y, z of the flange in metres, A4, A5, A6 are A, B, C in rad, and A7 is the
redundancy, which a destination given as a pose leaves as it is. A pose with a coordinate beyond 2 m is out of reach.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias

from hil.values.control import ControlSetup
from hil.values.errors import MalformedDatagram
from hil.values.frames import Frame, FrameKind, FrameTree
from hil.values.fri import ControlMode, OperationMode, SafetyState
from hil.values.load import Load
from hil.values.motion import ErrorReason, FineInterpolatorState, MotionEnd, MotionKind, MotionPhase
from hil.values.operator import OperatorView, ProgramState
from hil.values.pose import Pose
from hil.values.servo import (
    MAX_REPORTS_IN_PACKET,
    PROTOCOL_VERSION,
    ChangeControlMode,
    Command,
    DescribeFrame,
    Ended,
    FlangeLocated,
    FrameDescribed,
    FromController,
    GoalReached,
    Goodbye,
    Hello,
    LoadValidated,
    LocateFlange,
    MotionEnded,
    MotionState,
    PushArm,
    Refused,
    Report,
    Request,
    RequestDone,
    RequestError,
    Role,
    ServoClientCodec,
    ServoControllerCodec,
    SetDestination,
    SetRuntimeParameters,
    Snapshot,
    StartMotion,
    State,
    StopMotion,
    ValidateLoad,
    Vector,
    Welcome,
)

MS = 1_000_000
UNIX_EPOCH_NS = 1_795_322_390 * 10**9
TICKS_TO_GOAL = 3
SOFTWARE, ROBOT = "stand-in 1.0", "lbr-iiwa-14-r820"
START: Vector = (0.0, 0.5, 0.0, 0.7, 0.0, 1.5, 0.0)
PRESS_START = "the program is paused: press start (hil pad start)"
RUNNING = OperatorView(
    OperationMode.AUT, ProgramState.RUNNING, False, 100.0, SafetyState.NORMAL_OPERATION, reason="", permissive=False
)
PAUSED = RUNNING._replace(program=ProgramState.PAUSED, reason=PRESS_START)
STOPPED_BY_APPLICATION = "stopped by the application"
NOT_ACTIVE = "waitForTransferred called prematurely - RealtimeMotion is not active"


Outcome: TypeAlias = tuple[RequestError, str, str]
TAKEN: Outcome = RequestError.NONE, "", ""
REACH_M = 2.0
FRAMES = FrameTree(
    [
        Frame(
            "gripper",
            FrameKind.TOOL,
            "flange",
            Pose.from_abc_deg((0.0, 0.0, 0.05), 0, 0, 30),
            Load(1.5, (0.0, 0.0, 0.04), (0.01, 0.01, 0.005), (0.0, 0.0, 0.0)),
        ),
        Frame("tip", FrameKind.TOOL_FRAME, "gripper", Pose.from_abc_deg((0.01, -0.02, 0.15), 0, 0, 0)),
        Frame("side", FrameKind.TOOL_FRAME, "gripper", Pose.from_abc_deg((0.0, 0.1, 0.0), 90, 0, 0)),
        Frame("table", FrameKind.REFERENCE, "world", Pose.from_abc_deg((0.8, 0.1, 0.0), 45, 0, 0)),
        Frame("hole", FrameKind.REFERENCE, "table", Pose.from_abc_deg((0.1, 0.2, 0.02), 0, 180, 0)),
    ],
    base_in_world=Pose.from_abc_deg((0.1, 0.0, 0.9), 90, 0, 0),
)


FIRST = len(FRAMES) + 1
"""Number of the first request of a client that has fetched the frames."""


def forward(position: Vector) -> Pose:
    """Return where the flange of the arm that is none is in the base."""
    x, y, z, a, b, c, _ = position
    return Pose.from_abc_rad((x, y, z), a, b, c)


def nearest(flange_in_base: Pose, position: Vector) -> Vector | None:
    """Return the axis positions of a pose; A7 is the one of ``position``. None where it is out of reach."""
    if max(map(abs, flange_in_base.position_m)) > REACH_M:
        return None
    return (*flange_in_base.position_m, *flange_in_base.abc_rad(), position[6])


class ServoCodecs(ServoClientCodec, ServoControllerCodec, Protocol):
    """Both directions."""


@dataclass
class Moving:
    """A motion that runs or waits."""

    start: StartMotion
    destination: Vector
    destination_at_ns: int
    ticks_to_goal: int = TICKS_TO_GOAL
    arrives: bool = False
    rested_ns: int = 0
    goals_reached: int = 0
    received: int = 0
    waits: bool = True
    """Whether its destinations wait while the program is paused."""
    began: bool = False


@dataclass
class StandIn:
    """A controller with at most one session; ``outgoing`` holds the datagrams it sent since they were fetched."""

    codec: ServoCodecs
    state_period: int = 5
    """In ticks of 1 ms."""
    operator: OperatorView = RUNNING
    """What the pad shows; :meth:`pause` and :meth:`resume` change it."""
    refusal: Refused | None = None
    """What it answers hellos with, if not with a welcome."""
    answers_commands: bool = True
    holds: bool = False
    """Whether a destination is reached only when the test says so: :meth:`arrive`."""
    frames: FrameTree = field(default_factory=lambda: FRAMES)
    valid_frames: tuple[str, ...] = ("flange",)
    """Frames whose load is the true one."""
    now_ns: int = 0
    token: int = 0
    outgoing: list[bytes] = field(default_factory=list)
    taken: list[Request] = field(default_factory=list)
    """Requests that change something, in the order they were done."""
    questions: list[DescribeFrame | LocateFlange | ValidateLoad] = field(default_factory=list)
    """The others."""
    left: int = 0
    """Sessions that said goodbye."""
    hellos: list[Hello] = field(default_factory=list)
    commands: int = 0
    on_command: Callable[[Command], None] = lambda _: None
    """Is shown every command taken."""
    told: int = 0
    """Reports made."""
    motions: list[Moving] = field(default_factory=list)
    position: Vector = START
    reports: deque[Report] = field(default_factory=deque)
    _sequence: int = 0
    _state_sequence: int = 0
    _requests_done: int = 0
    _requests_received: int = 0
    _inbox: deque[Request] = field(default_factory=deque)
    _wants_state: bool = False
    _ticks: int = 0
    _tokens: dict[int, int] = field(default_factory=dict)
    _offered: set[int] = field(default_factory=set)

    def receive(self, datagram: bytes) -> None:
        """Take a datagram of a client."""
        try:
            packet = self.codec.decode_from_client(datagram)
        except MalformedDatagram:
            return
        if isinstance(packet, Hello):
            self.hellos.append(packet)
            self._hello(packet)
            return
        if not self.answers_commands:
            return
        if packet.token in self._offered:
            self._begin(packet.token)
        if packet.token == self.token and packet.sequence > self._sequence:
            self._sequence = packet.sequence
            if isinstance(packet, Goodbye):
                self.left += 1
                self.token = 0
            else:
                self._command(packet)

    def tick(self) -> None:
        """Let a millisecond pass."""
        self.now_ns += MS
        self._ticks += 1
        self._work()
        if self.operator.program is ProgramState.RUNNING:
            self._move()
        if self._sequence and self.token and (self._wants_state or self._ticks % self.state_period == 0):
            self.send(self.state())

    def fetch(self) -> list[bytes]:
        """Return what was sent since the last call."""
        sent, self.outgoing = self.outgoing, []
        return sent

    def send(self, packet: FromController) -> None:
        """Send a packet."""
        self.outgoing.append(self.codec.encode_from_controller(packet))

    def state(self) -> State:
        """Return the next state packet."""
        self._state_sequence += 1
        self._wants_state = False
        unseen = tuple(list(self.reports)[:MAX_REPORTS_IN_PACKET])
        return State(
            self.token, self._state_sequence, self._sequence, self._requests_done, self.snapshot(), reports=unseen
        )

    def snapshot(self) -> Snapshot:
        """Return what a state packet shows now."""
        shown = tuple(self._shown(place, motion) for place, motion in enumerate(self.motions))
        still = (0.0,) * 7
        return Snapshot(
            self.now_ns,
            self._ticks,
            self.operator,
            self.position,
            self.position,
            still,
            still,
            forward(self.position),
            ControlSetup(self.motions[0].start.mode).kind if self.motions else ControlMode.POSITION,
            still,
            still[:6],
            still[:6],
            "test",
            shown,
        )

    def pause(self) -> None:
        """Let go of the start key."""
        self.operator = PAUSED

    def resume(self) -> None:
        """Press the start key."""
        self.operator = RUNNING

    @property
    def states_sent(self) -> int:
        """Number of the last state."""
        return self._state_sequence

    @property
    def waiting(self) -> list[Request]:
        """What was asked and is not done, because the program is paused."""
        return list(self._inbox)

    def end(self, reason: str) -> None:
        """End the session."""
        self.send(Ended(self.token, reason))
        self.token = 0

    def fail(self, reason: str, detail: str = "") -> None:
        """Let the first motion fail."""
        self._end(self.motions[0], MotionEnd.FAILED, reason, detail)

    def arrive(self) -> None:
        """Let the first motion reach its destination with the next tick."""
        self.motions[0].ticks_to_goal = 1
        self.motions[0].arrives = True

    def report(self, make: Callable[[int], Report]) -> None:
        """Report something."""
        self.told += 1
        self.reports.append(make(self.told))
        self._wants_state = True

    def _hello(self, hello: Hello) -> None:
        if self.refusal is not None:
            self.send(self.refusal._replace(nonce=hello.nonce))
            return
        token = self._tokens.setdefault(hello.nonce, 1001 + len(self._tokens))
        if token != self.token:
            self._offered.add(token)
        self.send(Welcome(PROTOCOL_VERSION, hello.nonce, token, SOFTWARE, ROBOT, 1, UNIX_EPOCH_NS))

    def _begin(self, token: int) -> None:
        self._offered.discard(token)
        self.token = token
        self._sequence = self._state_sequence = self._requests_done = self._requests_received = self.told = 0
        self._inbox.clear()
        self.reports.clear()
        self.motions.clear()

    def _command(self, command: Command) -> None:
        self.commands += 1
        self.on_command(command)
        self._wants_state |= command.wants_state
        while self.reports and self.reports[0].number <= command.reports_seen:
            self.reports.popleft()
        for request in command.requests:
            if request.number > self._requests_received:
                self._requests_received = request.number
                self._inbox.append(request)
        self._work()

    def _work(self) -> None:
        """Do what was asked, in its order, up to a destination that waits for the program to run."""
        while self._inbox:
            request = self._inbox[0]
            moving = self._moving(request.motion) if isinstance(request, SetDestination) else None
            held = moving is not None and moving.waits and self.operator.program is ProgramState.PAUSED
            if moving is not None and held and not self._released(moving):
                return
            self._inbox.popleft()
            if held and self._is_superseded(request):
                continue
            self._requests_done = request.number
            if isinstance(request, DescribeFrame | LocateFlange):
                self.questions.append(request)
            else:
                self.taken.append(request)
            self._do(request, stopped=held and moving is not None and moving.waits)

    def _released(self, moving: Moving) -> bool:
        """Whether something that was asked later lets the destination that waits for ``moving`` go."""
        number = moving.start.number
        for later in list(self._inbox)[1:]:
            if isinstance(later, SetRuntimeParameters) and later.motion == number and later.wait_for_pause is False:
                moving.waits = False
                return True
            if isinstance(later, StopMotion | SetDestination) and later.motion == number:
                return True
        return False

    def _is_superseded(self, request: Request) -> bool:
        return isinstance(request, SetDestination) and any(
            isinstance(later, SetDestination) and later.motion == request.motion for later in self._inbox
        )

    def _moving(self, number: int) -> Moving | None:
        return next((moving for moving in self.motions if moving.start.number == number), None)

    def _do(self, request: Request, *, stopped: bool) -> None:
        refused = RequestError.COMMAND_INVALID, STOPPED_BY_APPLICATION, ""
        error, reason, detail = refused if stopped else self._outcome(request)
        at_ns = self.now_ns
        self.report(lambda number: RequestDone(number, request.number, at_ns, error, reason, detail))

    def _outcome(self, request: Request) -> Outcome:
        if isinstance(request, DescribeFrame | LocateFlange | ValidateLoad):
            return self._answer(request)
        if isinstance(request, StartMotion):
            return self._start(request)
        if isinstance(request, PushArm):
            operator = self.hellos[-1].role is Role.OPERATOR
            return TAKEN if operator else (RequestError.ILLEGAL_STATE, "only an operator pushes the arm", "")
        moving = self._moving(request.motion)
        if moving is None:
            return RequestError.COMMAND_INVALID, "it has ended", f"request {request.number}"
        return self._change(moving, request)

    def _change(
        self, moving: Moving, request: SetDestination | ChangeControlMode | StopMotion | SetRuntimeParameters
    ) -> Outcome:
        if isinstance(request, SetDestination):
            return self._set_destination(moving, request)
        if isinstance(request, ChangeControlMode):
            return self._change_mode(moving, request)
        return self._stop(moving) if isinstance(request, StopMotion) else self._set_parameters(moving, request)

    @staticmethod
    def _change_mode(moving: Moving, request: ChangeControlMode) -> Outcome:
        if type(request.mode) is not type(moving.start.mode):
            return RequestError.ILLEGAL_ARGUMENT, "the kind stays", ""
        moving.start = moving.start._replace(mode=request.mode)
        return TAKEN

    def _set_parameters(self, moving: Moving, request: SetRuntimeParameters) -> Outcome:
        if request.minimum_execution_time_s == 1e9:
            return RequestError.ILLEGAL_ARGUMENT, "too long for a test", "1e9 s"
        if request.wait_for_pause is not None:
            moving.waits = request.wait_for_pause
        return TAKEN

    def _stop(self, moving: Moving) -> Outcome:
        if moving is not self.motions[0]:
            return RequestError.ILLEGAL_STATE, NOT_ACTIVE, ""
        self._end(moving, MotionEnd.STOPPED, STOPPED_BY_APPLICATION, "")
        return TAKEN

    def _start(self, request: StartMotion) -> Outcome:
        waits = request.parameters.wait_for_pause
        destination = request.destination or self.position
        if request.flange_in_base is not None:
            destination = nearest(request.flange_in_base, self.position) or self.position
        self.motions.append(Moving(request, destination, self.now_ns, waits=waits))
        return TAKEN

    def _set_destination(self, moving: Moving, request: SetDestination) -> Outcome:
        position = request.position
        if request.flange_in_base is not None:
            position = nearest(request.flange_in_base, self.position)
            if position is None:
                return self._fail(moving, ErrorReason.POSITIONAL_LIMITS, f"beyond {REACH_M:g} m")
        if position is None or len(position) != 7:
            return self._fail(moving, ErrorReason.NUMBER_OF_DOFS, f"{len(position or ())} axes")
        moving.destination, moving.destination_at_ns = position, self.now_ns
        moving.ticks_to_goal, moving.received, moving.arrives = TICKS_TO_GOAL, moving.received + 1, False
        return TAKEN

    def _fail(self, moving: Moving, reason: str, detail: str) -> Outcome:
        self._end(moving, MotionEnd.FAILED, reason, detail)
        return RequestError.COMMAND_INVALID, reason, detail

    def _answer(self, request: DescribeFrame | LocateFlange | ValidateLoad) -> Outcome:
        """Report the answer to a question, before the report that it is done."""
        if isinstance(request, DescribeFrame):
            frames = list(self.frames.values())
            if request.place >= len(frames):
                return RequestError.ILLEGAL_ARGUMENT, f"there is no frame {request.place}", ""
            self.report(lambda number: FrameDescribed(number, request.number, len(frames), frames[request.place]))
        elif isinstance(request, ValidateLoad):
            reason = "" if request.frame in self.valid_frames else "the load is another"
            self.report(lambda number: LoadValidated(number, request.number, reason))
        else:
            self.report(lambda number: FlangeLocated(number, request.number, forward(request.position)))
        return TAKEN

    def _move(self) -> None:
        if not self.motions:
            return
        moving = self.motions[0]
        moving.began = True
        if moving.ticks_to_goal and self.holds and not moving.arrives:
            return
        if moving.ticks_to_goal:
            moving.ticks_to_goal -= 1
            if not moving.ticks_to_goal:
                moving.arrives = False
                moving.goals_reached += 1
                moving.rested_ns = 0
                self.position = moving.destination
                at_ns, position, own = self.now_ns, self.position, moving.start.number
                self.report(lambda number: GoalReached(number, own, at_ns, FineInterpolatorState.RESTING, position))
        elif moving.start.kind is MotionKind.PTP:
            self._end(moving, MotionEnd.FINISHED, "the point was reached", "")
        else:
            moving.rested_ns += MS
            if moving.rested_ns > moving.start.parameters.timeout_after_goal_s * 1e9:
                self._end(moving, MotionEnd.FINISHED, "timeout after the destination was reached", "")

    def _end(self, moving: Moving, end: MotionEnd, reason: str, detail: str) -> None:
        self.motions.remove(moving)
        at_ns, own = self.now_ns, moving.start.number
        self.report(lambda number: MotionEnded(number, own, at_ns, end, reason, detail))

    def _shown(self, place: int, moving: Moving) -> MotionState:
        waits = place > 1 or (self.operator.program is ProgramState.PAUSED and not moving.began)
        phase = MotionPhase.QUEUED if waits else (MotionPhase.ACTIVE, MotionPhase.TRANSFERRED)[place]
        return MotionState(
            moving.start.number,
            moving.start.kind,
            phase,
            FineInterpolatorState.MOVING if moving.ticks_to_goal else FineInterpolatorState.RESTING,
            moving.destination,
            moving.destination_at_ns,
            moving.ticks_to_goal * 1e-3,
            moving.goals_reached,
            moving.received,
            0,
            moving.received,
            moving.destination_at_ns,
        )
