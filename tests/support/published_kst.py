"""A KST client written as the published ones are (kst-wire 2, 6, 8): one send a request, one recv a reply, no framing.

It takes what one ``recv`` gives for the whole reply, whatever that is; it never looks for a line end and keeps nothing.
Its sessions are those of the published examples; only speeds and pauses can be other ones, so that tests are quick.
"""

import math
import socket
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final, Self

from hil.clock import Pause, stopwatch_ns

START: Final = (0.0, 0.0, 0.0, -math.pi / 2.0, 0.0, math.pi / 2.0, 0.0)
PATIENCE_S: Final = 60.0
"""Published clients wait for ever; a test does not."""
FASTEST_MM_S: Final = 400.0
_BETWEEN_NS: Final = 2_000_000
"""Least time between a reply and the next set-point."""


def up(value: float, digits: int) -> float:
    """Round as published clients do: towards plus infinity."""
    scale = 10.0**digits
    return math.ceil(value * scale) / scale


def joined(values: Sequence[float], digits: int | None = None) -> str:
    """Return values as a published client joins them."""
    return "".join(f"{value if digits is None else up(value, digits)}_" for value in values)


def pose_text(pose: Sequence[float], digits: int) -> str:
    """Return a pose: positions are rounded, angles are not."""
    return joined(pose[:3], digits) + joined(pose[3:])


@dataclass
class PublishedClient:
    """One session. ``haste`` is how many times faster motions are, and shorter pauses, than in the examples."""

    address: tuple[str, int]
    haste: float = 1.0
    unexpected: list[tuple[str, bytes]] = field(default_factory=list)
    """Replies that were not the one expected: where client and server are out of step."""
    set_points: int = 0

    def __enter__(self) -> Self:
        self._socket = socket.create_connection(self.address, timeout=PATIENCE_S)
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def rest(self, seconds: float) -> None:
        """Pause, as the client does after most of its requests."""
        pause, now_ns = Pause(1.0), stopwatch_ns()
        pause.until(now_ns)
        pause.until(now_ns + int(seconds / self.haste * 1e9))

    def request(self, text: str, expected: bytes | None = b"done\n") -> bytes:
        """One send, one recv."""
        self._socket.send(text.encode())
        return self.reply(text, expected)

    def reply(self, text: str, expected: bytes | None = b"done\n") -> bytes:
        """One recv is one reply."""
        reply = self._socket.recv(1024)
        if reply == b"" or (expected is not None and reply != expected):
            self.unexpected.append((text, reply))
        return reply

    def numbers(self, text: str, count: int) -> list[float]:
        """A getter: keeps what is a number."""
        reply = self.request(text, None)
        values = [float(part) for part in reply.decode().split("_") if part.strip() and part.strip() != "done"]
        if len(values) != count:
            self.unexpected.append((text, reply))
        return values[:count]

    def pose(self) -> list[float]:
        """Getter of the pose."""
        return self.numbers("Eef_pos\n", 6)

    def speed(self, value: float) -> None:
        """Joint motions 0..1, the others mm/s."""
        faster = min(1.0, value * self.haste) if value <= 1.0 else min(FASTEST_MM_S, value * self.haste)
        self.request(f"jRelVel_{faster}_\n")
        self.rest(0.05)

    def motion(self, start: str) -> None:
        """A start line, and its two replies."""
        self.request(f"{start}\n")
        self.rest(0.05)
        self.reply(f"{start}, its end")

    def ptp(self, joints: Sequence[float], speed: float = 0.1) -> None:
        """To axis positions."""
        self.speed(speed)
        self.request(f"jp_{joined(joints, 4)}\n\n")
        self.motion("doPTPinJS")

    def line(self, values: Sequence[float], speed: float, start: str = "doPTPinCS") -> None:
        """To a pose, or by a way."""
        self.speed(speed)
        self.request(f"cArtixanPosition_{pose_text(values, 4)}\n\n")
        self.motion(start)

    def circle(self, auxiliary: Sequence[float], end: Sequence[float], speed: float) -> None:
        """Through one pose to another."""
        self.speed(speed)
        self.request(f"cArtixanPositionCirc1_{joined(auxiliary, 4)}\n\n")
        self.request(f"cArtixanPositionCirc2_{joined(end, 4)}\n\n")
        self.motion("doPTPinCSCircle1_")

    def mode(self, line: str) -> None:
        """Start or stop a real-time mode."""
        self.request(f"{line}\n")
        self.rest(0.3)

    def stream(self, seconds: float, line: Callable[[float], str], expected: bytes | None, count: int = 0) -> float:
        """Set-points for ``seconds``, more than 2 ms after the last reply each; return how many a second."""
        began_ns = replied_ns = stopwatch_ns()
        sent = 0
        while (now_ns := stopwatch_ns()) - began_ns < seconds * 1e9:
            if now_ns - replied_ns > _BETWEEN_NS:
                reply = self.request(line((now_ns - began_ns) * 1e-9), expected)
                if count and reply.count(b"_") != count:
                    self.unexpected.append(("set-point", reply))
                replied_ns = stopwatch_ns()
                sent += 1
        self.set_points += sent
        return sent / seconds

    # --- sessions ---------------------------------------------------------------------------------------------

    def preamble(self) -> None:
        """The light on and off, one second after connecting and three."""
        self.rest(1.0)
        self.request("blueOn\n")
        self.rest(2.0)
        self.request("blueOff\n")

    def end(self) -> None:
        """Says goodbye, and reads nothing."""
        self._socket.send(b"end\n")
        self.rest(1.0)

    def getters(self) -> dict[str, list[float]]:
        """Every query."""
        self.preamble()
        found = {"pose": self.pose(), "force": self.numbers("Eef_force\n", 3)}
        self.pose()
        found["moment"] = self.numbers("Eef_moment\n", 3)
        found["joints"] = self.numbers("getJointsPositions\n", 7)
        found["external"] = self.numbers("Torques_ext_J\n", 7)
        found["measured"] = self.numbers("Torques_m_J\n", 7)
        self.numbers("Torques_m_J\n", 7)
        self.pose()
        self.pose()
        self.end()
        return found

    def ptp_motion(self, tool: str = "") -> list[list[float]]:
        """All motions, among them arcs about points that are reckoned from the pose that was read."""
        if tool:
            self.request(f"TFtrans_{tool}\n")
        self.preamble()
        self.ptp(START)
        x, y, z, *angles = self.pose()
        self.line((x + 30.0, y, z, *angles), 30.0)
        self.line((x + 30.0, y, z - 50.0, *angles), 10.0)
        self.ptp((0.0, 0.3491, 0.0, -1.2217, 0.0, 1.0472, 0.0))
        seen = [self.pose()]
        for start in ("doPTPinCSRelBase", "doPTPinCSRelEEF"):
            for way in (100.0, -100.0):
                self.line((0.0, 0.0, way, 0, 0, 0), 150.0, start)
        seen.append(self.pose())
        self.ptp((0.0, -0.1745, 0.0, -1.7453, math.pi / 2.0, math.pi / 2.0, 0.0))
        x, y, z, a, b, c = self.pose()
        self.circle((x, y + 75.0, z - 75.0, a, b, c + math.pi / 8.0), (x, y, z - 150.0, a, b, c + math.pi / 2.0), 50.0)
        self.ptp((0.0, 0.3491, 0.0, -1.2217, 0.0, math.pi / 2.0, 0.0), 0.15)
        self.line((0.0, 0.0, -100.0, 0, 0, 0), 50.0, "doPTPinCSRelBase")
        centre = self.pose()
        self.line((50.0, 0.0, 0.0, 0, 0, 0), 50.0, "doPTPinCSRelBase")
        seen.append(self.pose())
        self.circle(*self._arc(self.pose(), centre, math.pi / 2.0, (0.0, math.sqrt(0.5), math.sqrt(0.5))), 100.0)
        self.line(seen[-1], 150.0)
        here = self.pose()
        self.pose()
        self.circle(*self._arc(here, centre, 1.98 * math.pi, (0.0, 1.0, 0.0)), 150.0)
        seen.append(self.pose())
        self.end()
        return seen

    @staticmethod
    def _arc(
        here: Sequence[float], centre: Sequence[float], angle: float, across: Sequence[float]
    ) -> tuple[list[float], list[float]]:
        """Return the middle and the end of an arc that begins at ``here``, towards ``across``."""
        spoke = [a - b for a, b in zip(here[:3], centre[:3], strict=True)]
        radius = math.hypot(*spoke)

        def at(turned: float) -> list[float]:
            point = [
                c + math.cos(turned) * s + math.sin(turned) * radius * w
                for c, s, w in zip(centre[:3], spoke, across, strict=True)
            ]
            return [*point, *here[3:]]

        return at(angle / 2.0), at(angle)

    def direct_servo_joints(self, seconds: float) -> float:
        """A swing of the first axis; return the rate."""
        self.preamble()
        self.ptp(START)
        start = self.numbers("getJointsPositions\n", 7)
        self.mode("startDirectServoJoints")
        rate = self.stream(seconds, lambda at_s: f"jp_{self._swing(start, at_s, seconds)}\n\n", b"done\n")
        self.mode("stopDirectServoJoints")
        self.ptp((math.pi / 3.0 / 4.0, *START[1:]))
        self.end()
        return rate

    def direct_servo_cartesian(self, seconds: float, token: str) -> float:
        """A sine of the height with feedback; return the rate."""
        self.preamble()
        self.ptp(START)
        x, y, z, *angles = self.pose()
        self.mode("stDcEEf_")

        def line(at_s: float) -> str:
            height = z + 30.0 * math.sin(2.0 * math.pi * at_s / max(seconds, 1.0))
            return f"{token}_{pose_text((x, y, height, *angles), 3)}\n\n"

        rate = self.stream(seconds, line, None, count=7)
        self.mode("stopDirectServoJoints")
        self.ptp((math.pi / 3.0 / 4.0, *START[1:]))
        self.end()
        return rate

    def impedance(self, seconds: float) -> float:
        """Start, stop, start, set-points, stop: never reads the second acknowledgement of a stop."""
        start_line = "startSmartImpedanceJoints_1.0_0.0_0.0_0.0_900_80_50_"
        self.preamble()
        self.ptp(START)
        start = self.numbers("getJointsPositions\n", 7)
        for line in (start_line, "stopDirectServoJoints", start_line):
            self.mode(line)
        rate = self.stream(seconds, lambda at_s: f"jp_{self._swing(start, at_s, seconds)}\n\n", None)
        self.mode("stopDirectServoJoints")
        self.rest(0.5)
        self.ptp(START)
        self.end()
        return rate

    def impedance_with_feedback(self, seconds: float) -> float:
        """Set-points with measured torques back; ends with a reply unread."""
        self.preamble()
        self.ptp(START)
        start = self.numbers("getJointsPositions\n", 7)
        self.mode("startSmartImpedanceJoints_1.0_0.0_0.0_0.0_900_80_50_")
        rate = self.stream(seconds, lambda at_s: f"jpMT_{self._swing(start, at_s, seconds)}\n\n", None, count=7)
        self.mode("stopDirectServoJoints")
        self.end()
        return rate

    @staticmethod
    def _swing(start: Sequence[float], at_s: float, seconds: float) -> str:
        """Return joints of which the first one goes there and back."""
        swing = -0.15 * (1.0 - math.cos(2.0 * math.pi * at_s / seconds)) / 2.0
        return joined((start[0] + swing, *start[1:]), 4)
