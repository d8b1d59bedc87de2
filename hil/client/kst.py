"""A small client of KST servers, this one and real ones: lines, over TCP, with TCP_NODELAY and one write a request.

A client that reads lines, not segments, drains every acknowledgement, and says what went wrong::

    from hil.client.kst import KstClient

    with KstClient("127.0.0.1") as arm:
        arm.move_joints((0.0, 0.3, 0.0, -1.3, 0.0, 1.2, 0.0), velocity_rel=0.3)
        x, y, z, a, b, c = arm.pose()
        arm.move_line((x, y + 50.0, z, a, b, c), speed_mm_s=100.0)
        arm.start_joint_servo()
        for at_s in arm.every(0.002, seconds=5.0):
            arm.set_joints((0.2 * math.sin(at_s), 0.3, 0.0, -1.3, 0.0, 1.2, 0.0))
        arm.stop()

Joints in rad, A1 to A7; positions in mm, angles in rad as A, B, C; torques in Nm, forces in N.
"""

import socket
from collections.abc import Iterable, Iterator, Sequence
from enum import StrEnum
from types import TracebackType
from typing import Final, Self

from hil.clock import Deadline, Pause, stopwatch_ns
from hil.values.errors import EndpointError, HilError, PeerError
from hil.values.kst import KST_PORT
from transport.udp import parse_address

REPLY_MOST_BYTES: Final = 4096
START_S: Final = 0.3
"""After the start of a real-time mode: published servers overwrite what comes earlier."""
_DONE: Final = "done"
_NS_PER_S: Final = 1e9


class KstRefused(PeerError):
    """The server said ``nak``, or ``interrupted``, to a request."""

    def __init__(self, request: str, reply: str) -> None:
        self.request, self.reply = request, reply
        super().__init__(f"{request!r} was answered with {reply!r}; what is wrong stands in the server's log")


class KstSilent(EndpointError):
    """No reply came in time; a published server is silent for ever about what it does not know."""

    def __init__(self, request: str, timeout_s: float) -> None:
        self.request = request
        super().__init__(f"no reply to {request!r} within {timeout_s:g} s")


class KstClosed(EndpointError):
    """The server closed the connection."""


class Feedback(StrEnum):
    """What comes back for a set-point: the end of its command's name."""

    DONE = ""
    EXTERNAL_TORQUES = "ExT"
    MEASURED_TORQUES = "MT"
    JOINTS = "JP"
    POSE = "EEfP"


class KstClient:
    """One session; for one thread. ``server`` is ``HOST[:PORT]``, port 30001 unless given.

    A reply may take ``timeout_s``, the end of a motion ``motion_timeout_s``. Raises :class:`EndpointError` where nobody
    listens, and :class:`KstRefused`, :class:`KstSilent` or :class:`KstClosed` from all methods.
    """

    def __init__(self, server: str = "127.0.0.1", *, timeout_s: float = 5.0, motion_timeout_s: float = 120.0) -> None:
        self.round_trip_ms = 0.0
        """From the last request to its reply."""
        self._server = server
        self._timeout_s = timeout_s
        self._motion_timeout_s = motion_timeout_s
        self._socket: socket.socket | None = None
        self._received = b""
        self._in_impedance = False

    def __enter__(self) -> Self:
        address = parse_address(self._server, default_port=KST_PORT)
        try:
            self._socket = socket.create_connection(address, timeout=self._timeout_s)
        except OSError as error:
            raise EndpointError(f"cannot reach a KST server at TCP {address}: {error.strerror or error}") from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Say ``end`` and close; does nothing when it is closed."""
        link, self._socket = self._socket, None
        if link is not None:
            try:
                link.sendall(b"end\n")
            except OSError:
                pass
            finally:
                link.close()

    def joint_positions(self) -> tuple[float, ...]:
        """Return the measured axis positions."""
        return self._numbers("getJointsPositions", 7)

    def pose(self) -> tuple[float, ...]:
        """Return the pose of the tool in the robot base: x, y, z, A, B, C."""
        return self._numbers("Eef_pos", 6)

    def force(self) -> tuple[float, ...]:
        """Return the force at the tool along its axes."""
        return self._numbers("Eef_force", 3)

    def moment(self) -> tuple[float, ...]:
        """Return the moment at the tool about its axes, in Nm."""
        return self._numbers("Eef_moment", 3)

    def external_torques(self) -> tuple[float, ...]:
        """Return the axis torques the environment exerts."""
        return self._numbers("Torques_ext_J", 7)

    def measured_torques(self) -> tuple[float, ...]:
        """Return the measured axis torques."""
        return self._numbers("Torques_m_J", 7)

    def input_is_high(self, pin: int) -> bool:
        """Return the state of an input: 3, 4, 10, 13 or 16."""
        return self.ask(f"getPin{pin}") == "1"

    def set_output(self, name: str, on: bool) -> None:
        """Set ``blue`` (the light), ``pin1``, ``pin2``, ``pin11`` or ``pin12``."""
        state = "on" if on else "off"
        self._done(f"{name}{state.title() if name == 'blue' else state}")

    def attach_tool(self, tcp_in_flange: Sequence[float]) -> None:
        """Attach a tool without mass, by x, y, z, A, B, C of its TCP in the flange.

        Published clients do so once, first of all; published servers forget it at the next error.
        """
        self._done("TFtrans_" + _joined(tcp_in_flange))

    def move_joints(self, target: Sequence[float], *, velocity_rel: float) -> None:
        """PTP to axis positions at a share of the axis velocity, 0..1; return when it has ended."""
        self._done(f"jRelVel_{velocity_rel!r}_")
        self._done("jp_" + _joined(target))
        self._move("doPTPinJS")

    def move_line(self, target: Sequence[float], *, speed_mm_s: float) -> None:
        """Straight to a pose of the tool; return when it has ended."""
        self._target(target, speed_mm_s)
        self._move("doPTPinCS")

    def move_by(self, way_mm: Sequence[float], *, speed_mm_s: float, in_tool: bool = False) -> None:
        """Straight by x, y, z along the axes of the base, or of the tool; return when it has ended."""
        self._target((*way_mm, 0.0, 0.0, 0.0), speed_mm_s)
        self._move("doPTPinCSRelEEF" if in_tool else "doPTPinCSRelBase")

    def move_circle(self, auxiliary: Sequence[float], end: Sequence[float], *, speed_mm_s: float) -> None:
        """On the circle through an auxiliary pose to another one; return when it has ended."""
        self._done(f"jRelVel_{speed_mm_s!r}_")
        self._done("cArtixanPositionCirc1_" + _joined(auxiliary))
        self._done("cArtixanPositionCirc2_" + _joined(end))
        self._move("doPTPinCSCircle1_")

    def start_joint_servo(self) -> None:
        """Begin to follow :meth:`set_joints`."""
        self._start("startDirectServoJoints")

    def start_cartesian_servo(self) -> None:
        """Begin to follow :meth:`set_pose`."""
        self._start("stDcEEf_")

    def start_velocity_servo(self) -> None:
        """Begin to follow :meth:`set_velocities`."""
        self._start("stVelDcJoint_")

    def start_impedance(
        self,
        *,
        mass_kg: float,
        centre_mm: Sequence[float],
        translational_n_m: float,
        rotational_nm_rad: float,
        null_space_nm_rad: float,
    ) -> None:
        """Begin to follow :meth:`set_joints` on Cartesian springs, with the load of the tool that hangs on the flange.

        Servers do not say so where they refuse it: the arm does not move then.
        """
        springs = (translational_n_m, rotational_nm_rad, null_space_nm_rad)
        # The one spelling that published servers know.
        self._start("startSmartImpedneceJoints_" + _joined((mass_kg, *centre_mm, *springs)))
        self._in_impedance = True

    def set_joints(self, target: Sequence[float], feedback: Feedback = Feedback.DONE) -> tuple[float, ...]:
        """Set axis positions; return what was to come back."""
        return self._set(f"jp{feedback.value}_" + _joined(target), feedback)

    def set_velocities(self, velocities: Sequence[float], feedback: Feedback = Feedback.DONE) -> tuple[float, ...]:
        """Set axis velocities in rad/s; return what was to come back."""
        return self._set(f"velJDC{feedback.value}_" + _joined(velocities), feedback)

    def set_pose(self, target: Sequence[float], feedback: Feedback = Feedback.JOINTS) -> tuple[float, ...]:
        """Set the pose of the tool; return what was to come back. No published server acknowledges one without it."""
        return self._set(f"DcSeCar{feedback.value or 'W'}_" + _joined(target), feedback)

    def stream_joints(self, target: Sequence[float]) -> None:
        """Set axis positions; nothing comes back, and nothing tells whether they arrived."""
        self._send("jf_" + _joined(target))

    def stream_pose(self, target: Sequence[float]) -> None:
        """Set the pose of the tool; nothing comes back."""
        self._send("DcSeCar_" + _joined(target))

    def stop(self) -> None:
        """End the real-time mode; return when it has ended, as far as that is told."""
        self._done("stopDirectServoJoints")
        if self._in_impedance:
            self._in_impedance = False
            try:
                self._reply("stopDirectServoJoints, the second time", self._timeout_s)
            except KstSilent:
                # A server of this project can be told to leave it out.
                return
        else:
            self._rest(START_S)

    def every(self, period_s: float, *, seconds: float) -> Iterator[float]:
        """Yield the seconds since it began, every ``period_s``, for ``seconds``; late ones are not made up for."""
        pause, began_ns = Pause(1.0), stopwatch_ns()
        due_ns = now_ns = began_ns
        while now_ns - began_ns < seconds * _NS_PER_S:
            pause.until(due_ns)
            now_ns = stopwatch_ns()
            yield (now_ns - began_ns) / _NS_PER_S
            due_ns = max(due_ns + int(period_s * _NS_PER_S), stopwatch_ns())

    def ask(self, request: str) -> str:
        """Send a line of the protocol; return its reply, without its end."""
        began_ns = stopwatch_ns()
        self._send(request)
        reply = self._reply(request, self._timeout_s)
        self.round_trip_ms = (stopwatch_ns() - began_ns) * 1e-6
        return reply

    def _start(self, request: str) -> None:
        self._done(request)
        self._rest(START_S)

    def _rest(self, seconds: float) -> None:
        pause, now_ns = Pause(1.0), stopwatch_ns()
        pause.until(now_ns)
        pause.until(now_ns + int(seconds * _NS_PER_S))

    def _target(self, target: Iterable[float], speed_mm_s: float) -> None:
        self._done(f"jRelVel_{speed_mm_s!r}_")
        self._done("cArtixanPosition_" + _joined(target))

    def _move(self, request: str) -> None:
        self._done(request)
        reply = self._reply(f"{request}, its end", self._motion_timeout_s)
        if reply != _DONE:
            raise KstRefused(request, reply)

    def _set(self, request: str, feedback: Feedback) -> tuple[float, ...]:
        if feedback is Feedback.DONE:
            self._done(request)
            return ()
        return self._numbers(request, 6 if feedback is Feedback.POSE else 7)

    def _done(self, request: str) -> None:
        reply = self.ask(request)
        if reply != _DONE:
            raise KstRefused(request, reply)

    def _numbers(self, request: str, count: int) -> tuple[float, ...]:
        reply = self.ask(request)
        try:
            numbers = tuple(float(text) for text in reply.split("_") if text)
        except ValueError:
            raise KstRefused(request, reply) from None
        if len(numbers) != count:
            raise PeerError(f"{request!r} was answered with {len(numbers)} numbers, {count} are needed: {reply!r}")
        return numbers

    def _send(self, request: str) -> None:
        try:
            self._link().sendall(request.encode("ascii") + b"\n")
        except OSError as error:
            raise KstClosed(f"{request!r} cannot be sent: {error.strerror or error}") from error

    def _reply(self, request: str, timeout_s: float) -> str:
        deadline, link = Deadline(timeout_s), self._link()
        while True:
            line, end, rest = self._received.partition(b"\n")
            if end:
                self._received = rest
                # The reply of an input has an empty line behind it.
                if line:
                    return line.decode("ascii", "replace")
                continue
            if len(self._received) > REPLY_MOST_BYTES:
                raise PeerError(f"the reply to {request!r} has no end within {REPLY_MOST_BYTES} bytes")
            left_s = deadline.left_s()
            if left_s is not None and left_s <= 0.0:
                raise KstSilent(request, timeout_s)
            link.settimeout(left_s)
            try:
                data = link.recv(REPLY_MOST_BYTES)
            except TimeoutError:
                raise KstSilent(request, timeout_s) from None
            except OSError as error:
                raise KstClosed(f"the connection broke at {request!r}: {error.strerror or error}") from error
            if not data:
                raise KstClosed(f"the server closed the connection, {request!r} was not answered")
            self._received += data

    def _link(self) -> socket.socket:
        if self._socket is None:
            raise HilError("the KST client is not open; use it inside its with block")
        return self._socket


def _joined(numbers: Iterable[float]) -> str:
    return "".join(f"{float(number)!r}_" for number in numbers)
