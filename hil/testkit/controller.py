"""A controller in virtual time, as a test sees it: let time pass, look at everything, be the operator."""

import json
import math
from collections.abc import Callable, Coroutine, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TypeVar

from backends.robots import load_pinocchio
from hil import clock
from hil.client import _machine
from hil.client.fri import ClientSession, FriHandler
from hil.client.pad import PadRefused
from hil.config.station import RobotConfig
from hil.core.events import ArmStopped, Event
from hil.core.fri.link import FriLink
from hil.core.model import ArmModel
from hil.replay.conversations import fri_conversation, servo_conversation
from hil.replay.replay import Wish, packets_of
from hil.replay.stand_in_application import RecordedApplication
from hil.replay.stand_in_client import RecordedClient
from hil.runtime.assembly import make_servo_codec, robot_description
from hil.testkit._application_clock import virtual_time_module
from hil.testkit._attached import AttachedApplication, AttachedFri
from hil.testkit._event_loop import run_async
from hil.testkit._network import VirtualNetwork
from hil.testkit._schedule import Order
from hil.testkit._sockets import VirtualSocket
from hil.testkit._world import Route, World, WorldClock
from hil.testkit.errors import NeverHappened, told
from hil.testkit.operator import Operator
from hil.values.errors import ConfigurationError, UnknownName, UsageError
from hil.values.fri import Quality, Release, SessionState
from hil.values.operator import OperatorAction, OperatorView
from hil.values.pose import Pose
from hil.values.robot import Seven
from hil.values.signals import SignalValue
from transport.impairment import FaultNeverFired

_T = TypeVar("_T")


class VirtualController:
    """The controller of one robot. Times are in seconds since its first cycle, and are virtual.

    ``capture`` is a file that records it, for Wireshark and ``hil replay``. The arm begins at ``initial_position_rad``,
    or where its model does.
    Inside :meth:`active`, clients of :mod:`hil.client` find this controller at any address with the right port.
    """

    def __init__(
        self,
        config: RobotConfig,
        *,
        limit_s: float = 120.0,
        capture: Path | None = None,
        initial_position_rad: Seven | None = None,
    ) -> None:
        if not math.isfinite(limit_s) or limit_s <= 0.0:
            raise ConfigurationError(f"a limit of {limit_s} s of virtual time; more than 0 s is needed")
        if config.kst is not None:
            raise ConfigurationError("virtual time has no KST server, which is a process: use hil_process")
        self.config = config
        self._world = World(config, limit_s=limit_s, capture=capture, initial_position_rad=initial_position_rad)
        self._operator = _VirtualOperator(self._world)
        self._arm: ArmModel | None = None

    @contextmanager
    def active(self) -> Iterator[None]:
        """Put applications of this thread on the virtual network, and into virtual time, until the block ends."""
        with ExitStack() as stack:
            stack.callback(self._world.close)
            stack.enter_context(clock.using(WorldClock(self._world)))
            stack.enter_context(_machine.using(self._world))
            stack.enter_context(virtual_time_module(self._world))
            yield

    # Time

    @property
    def now_s(self) -> float:
        """Present time."""
        return self._world.now_ns * 1e-9

    def run(self, seconds: float) -> None:
        """Let time pass."""
        if not math.isfinite(seconds) or seconds < 0.0:
            raise ConfigurationError(f"cannot let {seconds} s pass; 0 s or more are needed")
        self._world.pass_ns(round(seconds * 1e9))

    def run_until(self, condition: Callable[[], object], at_most_s: float = 10.0) -> None:
        """Let time pass until ``condition`` holds; raise :class:`NeverHappened` if it does not in ``at_most_s``."""
        world = self._world
        if not world.wait(lambda: bool(condition()), until_ns=world.now_ns + round(at_most_s * 1e9)):
            raise NeverHappened(f"did not happen within {at_most_s:g} s; last events: {told(list(world.events))}")

    def run_async(self, main: Coroutine[Any, Any, _T]) -> _T:
        """Run a coroutine to its end, as ``asyncio.run`` does, in an event loop whose time is virtual."""
        return run_async(self._world, main)

    def after(self, seconds: float, action: Callable[[], object]) -> None:
        """Do ``action`` so long from now, whatever the application is waiting for then."""
        at_ns = self._world.now_ns + round(seconds * 1e9)
        self._world.order(Order(f"the action {seconds:g} s after {self.now_s:.3f} s", action, at_ns))

    def when(self, condition: Callable[[], object], action: Callable[[], object]) -> None:
        """Do ``action`` once, in the first control cycle in which ``condition`` holds."""
        what = f"the condition of the action that waits since {self.now_s:.3f} s"
        self._world.order(Order(what, action, condition=lambda: bool(condition())))

    # What the test does

    @property
    def operator(self) -> Operator:
        """The operator's pad."""
        return self._operator

    @property
    def network(self) -> "VirtualNetwork[Route]":
        """The network between the applications and this controller."""
        return self._world.network

    def attach_fri(self, handler: FriHandler) -> "AttachedFri[ClientSession]":
        """Let ``handler`` answer as the FRI client, while the test goes on; for handlers without a program around."""
        release, sock = self._fri_client()
        return AttachedFri(self._world, ClientSession(release, handler), sock)

    def attach_recorded_client(self, file: Path | str) -> "AttachedFri[RecordedClient]":
        """Let the first FRI client of the capture ``file`` answer: what it said in each session state, one by one.

        The counters are those of this session; ``session.ended`` tells when the recording has nothing more to say.
        Raises :class:`UsageError` for a capture without one, or of another release.
        """
        release, sock = self._fri_client()
        try:
            flow = fri_conversation(Path(file), Wish(release))
            return AttachedFri(self._world, RecordedClient(flow, packets_of(Path(file))), sock)
        except BaseException:
            sock.close()
            raise

    def attach_recorded_application(self, file: Path | str) -> "AttachedApplication":
        """Let the first servo application of the capture ``file`` speak: the same requests at the same times.

        ``session.over`` tells when it has nothing more to say. Raises :class:`UsageError` for a capture without one.
        """
        address = self._world.servo_address
        if address is None or self.config.servo is None:
            raise UsageError("this controller has no servo link; it was configured with servo=None")
        codec = make_servo_codec(self.config.servo)
        client, controller = servo_conversation(Path(file), codec)
        session = RecordedApplication(packets_of(Path(file)), client=client, controller=controller, codec=codec)
        return AttachedApplication(self._world, session, self._world.connect(address))

    def _fri_client(self) -> tuple[Release, VirtualSocket]:
        fri, peer = self.config.fri, self._world.fri_peer
        if fri is None or peer is None:
            raise UsageError("this controller has no FRI link; it was configured with fri=None")
        sock = self._world.bind(peer, controller=None)
        assert isinstance(sock, VirtualSocket)  # noqa: S101  # a world binds no other kind
        return fri.release, sock

    def shut_down(self) -> None:
        """End the controller in order: the arm brakes, all sessions are closed. Clients see that."""
        self._world.shut_down()

    # What there is to see

    @property
    def session_state(self) -> SessionState:
        """State of the FRI session."""
        return self._fri.state

    @property
    def quality(self) -> Quality:
        """Quality of the FRI connection."""
        return self._fri.quality

    @property
    def measured_position_rad(self) -> Seven:
        """Measured axis positions."""
        return self._world.parts.backend.read().position_rad

    @property
    def measured_velocity_rad_s(self) -> Seven:
        """Measured axis velocities."""
        return self._world.parts.backend.read().velocity_rad_s

    @property
    def commanded_position_rad(self) -> Seven:
        """Axis positions the arm was commanded last."""
        return self._world.core.motion.set_point.position_rad

    @property
    def flange(self) -> Pose:
        """Measured pose of the flange in the robot base, metres."""
        x, y, z, *quaternion = self._model.flange_in_base_mm(self.measured_position_rad)
        w, i, j, k = quaternion
        return Pose.from_quaternion((x * 1e-3, y * 1e-3, z * 1e-3), (w, i, j, k))

    @property
    def flange_speed_mm_s(self) -> float:
        """Measured speed of the flange."""
        arm = self._world.parts.backend.read()
        return self._model.flange_speed_mm_s(arm.position_rad, arm.velocity_rad_s)

    @property
    def stands(self) -> bool:
        """Whether the arm is commanded to stand still, by no motion or a paused one."""
        return self._world.core.motion.stands

    @property
    def pad(self) -> OperatorView:
        """What the operator's pad shows: mode, whether motions may run, and if not, why."""
        return self._world.core.operator

    @property
    def commander(self) -> str:
        """The application that commands the arm over the servo link; empty when none does."""
        servo = self._world.core.servo
        return "" if servo is None else servo.commander

    @property
    def stops(self) -> Sequence[ArmStopped]:
        """The last stops, and ends of motions for an error; oldest first."""
        return tuple(self._world.core.stops)

    @property
    def last_stop(self) -> ArmStopped | None:
        """The last of them: ``category``, ``reason``, ``at_ns``. None: there was none."""
        stops = self._world.core.stops
        return stops[-1] if stops else None

    @property
    def closed(self) -> bool:
        """Whether the controller has ended."""
        return self._world.core.closed

    @property
    def events(self) -> Sequence[Event]:
        """What happened, oldest first, ten thousand at most; ``str`` says it in words."""
        return tuple(self._world.events)

    def told(self) -> list[str]:
        """Return what happened, in words, with its time."""
        return [f"[{event.at_ns / 1e9:9.3f} s] {event}" for event in self._world.events]

    def signal(self, name: str) -> SignalValue:
        """Return the value of the input or output ``Group.Name``."""
        report = self._world.core.signals.report()
        if name not in report:
            raise UnknownName("input or output", name, report)
        value = report[name]["value"]
        assert isinstance(value, bool | int | float)  # noqa: S101  # signals have no other values
        return value

    def report(self) -> dict[str, Any]:
        """Return the controller's figures, as the status file of ``hil run`` has them for a robot."""
        report: dict[str, Any] = json.loads(json.dumps(self._world.core.report()))
        return report

    # The end

    def never_happened(self) -> str:
        """Return what never happened: an action of ``after`` or ``when``, a fault that was armed; empty for nothing."""
        if waiting := self._world.orders.waiting:
            return f"never came before the test ended at {self.now_s:.3f} s: {'; '.join(one.what for one in waiting)}"
        try:
            self.network.require_fired()
        except FaultNeverFired as error:
            return str(error)
        return ""

    @property
    def _fri(self) -> FriLink:
        fri = self._world.core.fri
        if fri is None:
            raise UsageError("this controller has no FRI link; it was configured with fri=None")
        return fri

    @property
    def _model(self) -> ArmModel:
        # A model of the test's own: the controller's has memory that its monitors count on.
        if self._arm is None:
            self._arm = ArmModel(load_pinocchio(robot_description(self.config).name))
        return self._arm


class _VirtualOperator(Operator):
    def __init__(self, world: World) -> None:
        self._world = world

    def _do(self, action: OperatorAction) -> None:
        refusal = self._world.operate(action)
        if refusal:
            raise PadRefused(refusal, {})
