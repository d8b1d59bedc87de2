"""Controllers in a row, in virtual time and one thread: each is the Cabinet of the next one, down to one arm.

The first one (``cabinet``) has an arm of its own and ticks by the clock; each further one has a
:class:`CabinetBackend` for its robot side and ticks when a message comes, or, as the live shell does, once a period
when none has come for longer than it bears. The last one (``outer``) is what applications see.
"""

import heapq
from collections import defaultdict
from collections.abc import Callable
from itertools import count, pairwise
from typing import TYPE_CHECKING, Any, cast

from backends.base import InProcessBackend
from backends.cabinet.backend import CabinetBackend
from backends.cabinet.options import parse_options
from backends.robots import load_description, load_pinocchio
from hil.core.controller import FRI_LINK, ROBOT_SIDE_LINK, Controller
from hil.core.events import Event
from hil.core.model import ArmModel
from hil.core.servo.link import SERVO_LINK
from hil.core.settings import IDEAL_REACTION, ControllerSettings, FriSettings, SafetySettings, ServoSettings
from hil.values.arm import Backend
from hil.values.control import POSITION_CONTROL, ControlModeSettings
from hil.values.fri import OperationMode, OverlayKind, Release, SessionState
from hil.values.link import Address, Source
from hil.values.operator import PadKey, Press, SelectMode
from hil.values.robot import RobotDescription
from hil.values.servo import FromClient, FromController
from tests.support.servo_virtual import SECRET, Application, ServoBench
from tests.support.virtual import UNIX_EPOCH_NS, Client, RecordingBackend
from transport.fri import FriCodec
from transport.servo import ServoCodec

if TYPE_CHECKING:
    from hil.core.fri.link import FriLink

ROBOT = "lbr-iiwa-14-r820"
LATENCY_NS = 100_000
QUALITY_RISE_MS = 20
OVERLAY_RESTART_MS = 100
"""Shorter than the defaults: what is tested here is not how long these take."""
CLIENT = Address("127.0.0.1", 30219)
"""The FRI client of the last controller, if it has one."""


class Node:
    """One controller of the row; it is made when its robot side is ready."""

    def __init__(self, number: int, settings: ControllerSettings, backend: Backend, codec: FriCodec | None) -> None:
        self.number = number
        self.settings = settings
        self.backend = backend
        self.codec = codec
        self.servo_codec = None if settings.servo is None else ServoCodec(None)
        self.serves_from = Address("127.0.0.1", 40200 + number)
        self.events: list[Event] = []
        self.ticked_ns = 0
        self.made: Controller | None = None

    @property
    def controller(self) -> Controller:
        """The controller."""
        assert self.made is not None, self.cabinet_link.not_ready()
        return self.made

    @property
    def cabinet_link(self) -> CabinetBackend:
        """Its robot side, where that is a Cabinet."""
        assert isinstance(self.backend, CabinetBackend)
        return self.backend

    @property
    def fri(self) -> "FriLink":
        """Its FRI link."""
        assert self.controller.fri is not None
        return self.controller.fri

    def make(self, description: RobotDescription) -> None:
        """Begin, with whatever the robot side knows."""
        self.made = Controller(
            self.settings,
            description=description,
            model=ArmModel(load_pinocchio(ROBOT)),
            backend=self.backend,
            codec=self.codec,
            servo_codec=self.servo_codec,
        )


class Chain:
    """``depth`` controllers in a row; ``options`` are those of every link to a Cabinet."""

    def __init__(
        self,
        *,
        depth: int = 2,
        release: Release = Release.V1_15,
        backend: Callable[[RobotDescription], InProcessBackend] = RecordingBackend,
        cycle_ms: int = 1,
        send_period_ms: int | None = None,
        receive_multiplier: int = 1,
        mode: OperationMode = OperationMode.AUT,
        overlay: OverlayKind = OverlayKind.JOINT_POSITION,
        control: ControlModeSettings = POSITION_CONTROL,
        client: bool = False,
        options: dict[str, Any] | None = None,
        safety: SafetySettings | None = None,
    ) -> None:
        self.description = load_description(ROBOT)
        self.arm = backend(self.description)
        self.nodes: list[Node] = []
        for number in range(depth):
            last = number == depth - 1
            fri = FriSettings(
                peer=CLIENT if last else Address("127.0.0.1", 30200 + number),
                send_period_ms=send_period_ms or cycle_ms,
                receive_multiplier=1 if last else receive_multiplier,
                overlay=overlay,
                control=control,
                quality_rise_ms=QUALITY_RISE_MS,
                overlay_restart_ms=OVERLAY_RESTART_MS,
            )
            settings = ControllerSettings(
                operation_mode=mode,
                cycle_ms=cycle_ms,
                unix_epoch_ns=UNIX_EPOCH_NS,
                fri=fri if client or not last else None,
                servo=ServoSettings(software="fri-hil test", robot=ROBOT, token_secret=SECRET) if last else None,
                reaction=IDEAL_REACTION,
                safety=safety or SafetySettings(),
                enabled=number == 0,
            )
            chosen = {"release": release.value, "overlay": overlay.value, "bind": "127.0.0.1:0", **(options or {})}
            side: Backend = self.arm
            if number > 0:
                side = CabinetBackend(parse_options(chosen), cycle_ns=settings.cycle_ns)
            side.open(period_ns=settings.cycle_ns)
            codec = FriCodec(release) if settings.fri is not None else None
            self.nodes.append(Node(number, settings, side, codec))
        self.cabinet.make(self.description)
        self.client = Client(FriCodec(release), amplitude_rad=0.0) if client else None
        self.settings = self.outer.settings
        self.now_ns = -self.settings.cycle_ns
        self.sent: dict[Address, list[FromController]] = defaultdict(list)
        self.carries: Callable[[int, bytes], bytes | None] = lambda _link, payload: payload
        """Told the number of the Cabinet on a link and a datagram to or from it; returns what arrives, if anything."""
        self._due: list[tuple[int, int, int, Source, bytes]] = []
        self._order = count()

    @property
    def cabinet(self) -> Node:
        """The one with the arm."""
        return self.nodes[0]

    @property
    def outer(self) -> Node:
        """The one of the applications."""
        return self.nodes[-1]

    def application(self) -> Application:
        """Return an application of the outer controller that has joined."""
        made = Application(cast("ServoBench", self))
        made.join()
        return made

    def deliver(self, packet: FromClient | bytes, sender: Address) -> None:
        """Hand the outer controller a packet of an application now."""
        codec = self.outer.servo_codec
        assert codec is not None
        payload = packet if isinstance(packet, bytes) else codec.encode_from_client(packet)
        self.outer.controller.receive(payload, Source(SERVO_LINK, sender), now_ns=self.now_ns)

    def run(self, seconds: float) -> None:
        """Let time pass."""
        for _ in range(round(seconds * 1e9) // self.settings.cycle_ns):
            self.cycle()

    def run_until(self, condition: Callable[[], bool], *, at_most_s: float = 5.0) -> None:
        """Let time pass until ``condition`` holds; fail if that does not happen."""
        for _ in range(round(at_most_s * 1e9) // self.settings.cycle_ns):
            if condition():
                return
            self.cycle()
        raise AssertionError(f"did not happen in {at_most_s} s: {self.told()[-8:]}")

    def run_until_commanding(self) -> None:
        """Let time pass until the outer controller's set points reach the arm."""
        self.run_until(lambda: all(node.made is not None for node in self.nodes))
        self.run_until(lambda: all(node.backend.condition().takes_commands for node in self.nodes), at_most_s=15.0)

    def cycle(self) -> None:
        """One cycle of the Cabinet, and all that comes of it on the way."""
        self.now_ns += self.settings.cycle_ns
        self._deliver_until(self.now_ns)
        for node in self.nodes[1:]:
            silence_ns = node.cabinet_link.link.silence_ns
            if node.made is not None and self.now_ns - node.ticked_ns >= silence_ns:
                self._tick(node, self.now_ns, silent=True)
        self._tick(self.cabinet, self.now_ns)

    def press(self, node: Node, *keys: PadKey) -> list[str]:
        """Use keys of a pad, and return the refusals."""
        answers = [node.controller.operate(Press(key), now_ns=self.now_ns) for key in keys]
        return [answer for answer in answers if answer]

    def select(self, node: Node, mode: OperationMode) -> str:
        """Turn the mode selector; return the refusal."""
        return node.controller.operate(SelectMode(mode), now_ns=self.now_ns)

    def restart_cabinet(self) -> None:
        """A new controller has the arm, and counts its messages from 0."""
        assert self.cabinet.made is not None
        self._due.clear()
        self.cabinet.make(self.description)

    def states(self) -> list[SessionState]:
        """Session state of every FRI link."""
        return [node.fri.state for node in self.nodes if node.made is not None and node.made.fri is not None]

    def told(self) -> list[str]:
        """All events in words, with the number of the controller."""
        return [f"{node.number}: {event}" for node in self.nodes for event in node.events]

    def stops(self, node: Node) -> list[str]:
        """Reasons of all stops of a controller."""
        return [stop.reason for stop in node.controller.stops]

    def commanded(self, axis: int) -> list[float]:
        """Set points the arm was given, of one axis."""
        assert isinstance(self.arm, RecordingBackend)
        return [command.position_rad[axis] for command in self.arm.commands]

    def largest_step_rad(self, *, since: int = 0) -> float:
        """Largest step of any axis between two set points the arm was given."""
        assert isinstance(self.arm, RecordingBackend)
        commands = [command.position_rad for command in self.arm.commands[since:]]
        pairs = pairwise(commands)
        return max(abs(b - a) for first, second in pairs for a, b in zip(first, second, strict=True))

    def _deliver_until(self, now_ns: int) -> None:
        while self._due and self._due[0][0] <= now_ns:
            at_ns, _, number, source, payload = heapq.heappop(self._due)
            node = self.nodes[number]
            if node.made is None:
                side = node.cabinet_link
                if side.receive(payload, source.address, now_ns=at_ns) and not side.not_ready():
                    node.make(self.description)
                    node.ticked_ns = at_ns
            elif node.made.receive(payload, source, now_ns=at_ns):
                self._tick(node, at_ns)

    def _tick(self, node: Node, at_ns: int, *, silent: bool = False) -> None:
        if not silent:
            node.ticked_ns = at_ns
        controller = node.controller
        controller.tick(now_ns=at_ns)
        for outgoing in controller.outgoing():
            self._send(node, outgoing.link, outgoing.payload, outgoing.destination, at_ns)
        node.events += controller.events()

    def _send(self, node: Node, link: str, payload: bytes, destination: Address | None, at_ns: int) -> None:
        if link == SERVO_LINK:
            assert node.servo_codec is not None
            assert destination is not None
            self.sent[destination].append(node.servo_codec.decode_from_controller(payload))
        elif link == ROBOT_SIDE_LINK:
            here = self.nodes[node.number - 1]
            assert destination == here.serves_from
            assert here.settings.fri is not None
            self._carry(here.number, here, Source(FRI_LINK, here.settings.fri.peer), payload, at_ns)
        elif node is self.outer:
            assert self.client is not None
            answer = self.client.answer(payload)
            if answer is not None:
                self._push(at_ns + LATENCY_NS, node, Source(FRI_LINK, CLIENT), answer)
        else:
            source = Source(ROBOT_SIDE_LINK, node.serves_from)
            self._carry(node.number, self.nodes[node.number + 1], source, payload, at_ns)

    def _carry(self, number: int, to: Node, source: Source, payload: bytes, at_ns: int) -> None:
        arrives = self.carries(number, payload)
        if arrives is not None:
            self._push(at_ns + LATENCY_NS, to, source, arrives)

    def _push(self, at_ns: int, node: Node, source: Source, payload: bytes) -> None:
        heapq.heappush(self._due, (at_ns, next(self._order), node.number, source, payload))


def cut(chain: Chain, *, link: int = 0) -> None:
    """No datagram gets through to or from the Cabinet of that number any more."""
    chain.carries = lambda number, payload: None if number == link else payload


def mend(chain: Chain) -> None:
    """All datagrams get through again."""
    chain.carries = lambda _link, payload: payload
