"""What both shells share: settings of a client, its session with the clock's part in it, and goal events to tell."""

import secrets
import socket
from typing import Final

from hil.client._machine import DatagramSocket, virtual_machine
from hil.client.servo import _frames as frames
from hil.client.servo._frames import MovedFrame
from hil.client.servo.errors import IllegalArgumentException
from hil.client.servo.motions import Motion
from hil.client.servo.session import ServoSession
from hil.clock import Deadline
from hil.values.errors import ConfigurationError, EndpointError, OutOfRange, UsageError
from hil.values.frames import FrameTree
from hil.values.link import Address
from hil.values.motion import ParameterRange
from hil.values.operator import OperatorView
from hil.values.servo import (
    DEFAULT_STATE_PERIOD_MS,
    DEFAULT_WATCHDOG_MS,
    MAX_NAME_BYTES,
    MAX_STATE_PERIOD_MS,
    MAX_WATCHDOG_MS,
    MIN_STATE_PERIOD_MS,
    MIN_WATCHDOG_MS,
    SERVO_PORT,
    Role,
    Snapshot,
    Welcome,
)
from transport.servo import ServoCodec
from transport.udp import parse_address

KEEP_ALIVES_IN_WATCHDOG: Final = 5
"""So that four packets in a row may be lost."""
SILENT_WATCHDOGS: Final = 3
LEAST_SILENCE_S: Final = 1.0
STATES_IN_LATENCY_BUDGET: Final = 3
"""The least budget is so many state periods: a command reflects the state before it at best."""
FAREWELLS: Final = 3
"""Goodbyes sent: each of them may be lost, and then the controller's watchdog has to find out."""
DEFAULT_CONTROLLER: Final = f"127.0.0.1:{SERVO_PORT}"
_WATCHDOG = ParameterRange("watchdog", MIN_WATCHDOG_MS, MAX_WATCHDOG_MS, DEFAULT_WATCHDOG_MS, "ms")
_STATE_PERIOD = ParameterRange("state period", MIN_STATE_PERIOD_MS, MAX_STATE_PERIOD_MS, DEFAULT_STATE_PERIOD_MS, "ms")
_CONNECT_TIMEOUT = ParameterRange("connect timeout", 0.0, 86_400.0, 5.0, "s")


class ClientShell:
    """The part of a client that has no socket yet. ``controller`` is ``HOST[:PORT]``, port 30300 unless given.

    ``role`` is what it may do: one commander at a time, any number of observers. The controller takes the arm from a
    commander it has not heard for ``watchdog_ms``; it sends a state every ``state_period_ms``, or
    at the next multiple of its control cycle. It drops a command that
    reflects a state older than ``latency_budget_ms``: three state periods to the watchdog; None: the watchdog.
    ``key`` is the pre-shared key of the link, where it has one (:func:`load_key`). ``name`` is for people: 63 bytes of
    UTF-8.
    """

    def __init__(
        self,
        controller: str = DEFAULT_CONTROLLER,
        *,
        name: str = "",
        role: Role = Role.COMMANDER,
        watchdog_ms: int = DEFAULT_WATCHDOG_MS,
        state_period_ms: int = DEFAULT_STATE_PERIOD_MS,
        latency_budget_ms: int | None = None,
        key: bytes | None = None,
        connect_timeout_s: float = 5.0,
    ) -> None:
        self.role = Role(role)
        self._controller = controller
        self._name = name
        self._watchdog_ms = _whole(_WATCHDOG, watchdog_ms)
        self._state_period_ms = _whole(_STATE_PERIOD, state_period_ms)
        self._latency_budget_ms = 0
        if latency_budget_ms is not None:
            least_ms = STATES_IN_LATENCY_BUDGET * self._state_period_ms
            budget = ParameterRange("latency budget", least_ms, self._watchdog_ms, self._watchdog_ms, "ms")
            self._latency_budget_ms = _whole(budget, latency_budget_ms)
        self._connect_timeout_s = _CONNECT_TIMEOUT.check(connect_timeout_s)
        self._codec = ServoCodec(key)
        if len(name.encode(errors="replace")) > MAX_NAME_BYTES or not name.isprintable():
            raise ConfigurationError(f"the name {name!r} is no printable text of at most {MAX_NAME_BYTES} bytes")
        self.validation_failure = ""
        """Why the load validated last is not the true one; empty when it is."""
        self.session = self._new_session()
        """The session: its state, and its counters."""

    @property
    def controller(self) -> Welcome:
        """What the controller said of itself: software, robot, cycle, Unix time of its time 0."""
        welcome = self.session.welcome
        if welcome is None:
            raise not_open()
        return welcome

    @property
    def commander(self) -> str:
        """Who commands the arm, as the latest state says it; empty when nobody does."""
        return self._snapshot().commander

    @property
    def operator(self) -> OperatorView:
        """What the operator's pad shows, as the latest state says it: whether motions may run, and if not, why."""
        return self._snapshot().operator

    @property
    def frames(self) -> FrameTree:
        """All frames of the robot, as they were when the session began; they do not change while it runs."""
        if self.session.frames is None:
            raise not_open()
        return self.session.frames

    def _take(self, motion: object, frame: object) -> MovedFrame:
        """Let ``motion`` belong to this client; return the frame that is to be moved.

        Raises where it is no motion, or may not be started now, or the frame does not move.
        """
        if not isinstance(motion, Motion):
            raise IllegalArgumentException(f"{motion!r} is no motion; a SmartServo, a DirectServo or a PTP is needed")
        motion.bind(self)
        return frames.moved_frame(self.frames, frame)

    def _snapshot(self) -> Snapshot:
        snapshot = self.session.snapshot
        if snapshot is None:
            raise not_open()
        return snapshot

    def _new_session(self) -> ServoSession:
        return ServoSession(
            self._codec,
            role=self.role,
            watchdog_ms=self._watchdog_ms,
            state_period_ms=self._state_period_ms,
            name=self._name,
            nonce=_random_bits(64),
            latency_budget_ms=self._latency_budget_ms,
        )

    def _new_link(self) -> "Link":
        self.session = self._new_session()
        return Link(self.session, watchdog_s=self._watchdog_ms * 1e-3)


class Link:
    """A session and what the clock has to do with it. Sockets are the shells'."""

    def __init__(self, session: ServoSession, *, watchdog_s: float) -> None:
        self.session = session
        self._silence_s = max(LEAST_SILENCE_S, SILENT_WATCHDOGS * watchdog_s)
        self._silence = Deadline(self._silence_s)
        self._keep_alive = Deadline(watchdog_s / KEEP_ALIVES_IN_WATCHDOG)
        self._waits_without_datagram = 0
        self._handler_error: Exception | None = None

    def outgoing(self) -> bytes | None:
        """Return the datagram that is to be sent now, if any."""
        if self.patience_s() <= 0.0:
            self._keep_alive.restart()
            self.session.keep_alive()
        datagram = self.session.outgoing()
        if datagram is not None:
            self._keep_alive.restart()
        return datagram

    def patience_s(self) -> float:
        """Return how long, in seconds, nobody needs to look here unless a datagram comes."""
        return self._keep_alive.left_s() or 0.0

    def take(self, datagram: bytes) -> None:
        """Take a datagram."""
        states = self.session.states
        self.session.receive(datagram)
        self._waits_without_datagram = 0
        if self.session.states != states:
            self._silence.restart()

    def nothing_came(self) -> None:
        """A wait ended without a datagram; end the session when the controller is silent for too long."""
        # After a pause of our own process the time is up while datagrams wait to be read: hence the second look.
        self._waits_without_datagram += 1
        if self.session.running and self._waits_without_datagram > 1 and (self._silence.left_s() or 0.0) <= 0.0:
            trouble = f" ({self.session.trouble})" if self.session.trouble else ""
            self.session.end(f"nothing was heard of the controller for {self._silence_s:g} s{trouble}")

    @property
    def goals_to_tell(self) -> bool:
        """Whether :meth:`tell_goals` has something to do."""
        return bool(self.session.goals) and self._handler_error is None

    def tell_goals(self) -> None:
        """Call the handlers of goals reached; what one raises is kept, and no other is called before it was raised."""
        while self.goals_to_tell:
            record, report = self.session.goals.popleft()
            if record.on_goal is not None:
                try:
                    record.on_goal(report)
                except Exception as error:  # noqa: BLE001  # the next call raises it
                    error.add_note("raised by on_goal_reached_event, in the client's own thread or task")
                    self._handler_error = error

    def raise_kept(self, on_its_way: BaseException | None = None) -> None:
        """Raise what a handler raised; where another error is on its way already, note it there."""
        error, self._handler_error = self._handler_error, None
        if error is None:
            return
        if on_its_way is None:
            raise error
        on_its_way.add_note(f"before that, on_goal_reached_event raised {error!r}")


def open_socket(controller: Address) -> socket.socket:
    """Return a UDP socket that talks to ``controller`` alone, and does not block; raise :class:`EndpointError`."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        sock.setblocking(False)
        sock.connect(controller)
    except OSError as error:
        sock.close()
        raise EndpointError(f"cannot reach the controller at UDP {controller}: {error.strerror}") from error
    return sock


def _random_bits(count: int) -> int:
    machine = virtual_machine()
    return secrets.randbits(count) if machine is None else machine.random_bits(count)


def open_loop_socket(controller: Address) -> DatagramSocket:
    """Return what an event loop reads and writes to talk to ``controller`` alone; raise :class:`EndpointError`."""
    machine = virtual_machine()
    return open_socket(controller) if machine is None else machine.connect(controller)


def address_of(controller: str) -> Address:
    """Return the address of ``HOST[:PORT]``; raise :class:`ConfigurationError`."""
    # On a virtual machine every name is that of its controller, and no name server is asked.
    address = parse_address(controller, default_port=SERVO_PORT, resolve=virtual_machine() is None)
    if address.port == 0:
        raise ConfigurationError(f"{controller!r}: a controller has a port of its own, 1..65535")
    return address


def not_open() -> UsageError:
    """Return the error of a client used outside its ``with`` block."""
    return UsageError("the servo client is not open; use it inside its with block")


def _whole(valid: ParameterRange, value: float) -> int:
    number = valid.check(value)
    if not number.is_integer():
        raise OutOfRange(valid.name, number, f"of whole numbers, {valid.low:g} ... {valid.high:g} {valid.unit}")
    return int(number)
