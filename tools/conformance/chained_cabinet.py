"""A Cabinet backend on the bench: its Cabinet is our own controller over an arm of its own, in virtual time.

One period of it: what the backend answers reaches the Cabinet, the Cabinet's cycle runs, and its message reaches the
backend. A peer that is lost is one whose datagrams get through no more, either way; it goes on by itself meanwhile.
"""

from collections.abc import Callable
from typing import Final

from backends.base import InProcessBackend
from backends.cabinet.backend import CabinetBackend
from backends.cabinet.options import CabinetOptions
from backends.ideal import IdealBackend
from backends.rig import Rig
from backends.robots import load_description, load_pinocchio
from hil.core.controller import FRI_LINK, Controller
from hil.core.model import ArmModel
from hil.core.settings import ControllerSettings, FriSettings
from hil.values.arm import ArmState, Backend, JointCommand
from hil.values.errors import BackendError
from hil.values.fri import OperationMode, Release
from hil.values.link import Address, Source
from hil.values.robot import RobotDescription, Seven
from transport.fri import FriCodec

CABINET: Final = Address("127.0.0.1", 40200)
CLIENT: Final = Address("127.0.0.1", 30200)
LATENCY_NS: Final = 100_000
"""Of every datagram."""
_NS_PER_MS: Final = 1_000_000
_QUALITY_RISE_MS: Final = 20
_OVERLAY_RESTART_MS: Final = 100
_FIRST_CYCLES: Final = 10


class ChainedCabinetRig(Rig):
    """``arm`` makes the Cabinet's own robot side; ``release`` is what both speak."""

    has_peer = True

    def __init__(
        self,
        *,
        robot: str = "lbr-iiwa-14-r820",
        arm: Callable[[RobotDescription], InProcessBackend] = IdealBackend,
        release: Release = Release.V1_15,
    ) -> None:
        self._robot = robot
        self._description = load_description(robot)
        self._arm = arm(self._description)
        self._release = release
        self._backend = CabinetBackend(CabinetOptions(release=release, bind=str(CLIENT)), cycle_ns=_NS_PER_MS)
        self._cabinet: Controller | None = None
        self._now_ns = 0
        self._lost = False

    @property
    def backend(self) -> Backend:
        """The backend itself."""
        return self._backend

    @property
    def cabinet(self) -> Controller:
        """The controller that is its Cabinet; there is none before it was opened."""
        if self._cabinet is None:
            raise BackendError("the Cabinet has not been started")
        return self._cabinet

    def open(self, *, period_ns: int) -> None:
        """Open the backend and let the first messages of the Cabinet come, which is started with it."""
        self._backend.open(period_ns=period_ns)
        if self._cabinet is None:
            self._arm.open(period_ns=period_ns)
            self._cabinet = self._make_cabinet(period_ns)
        for _ in range(_FIRST_CYCLES):
            if not self._backend.not_ready():
                return
            self._pass_period()

    def cycle(self, command: JointCommand | None = None) -> ArmState:
        """Answer the newest message, and let one period pass on both sides."""
        if command is not None:
            self._backend.write(command)
        self._backend.step()
        for answer, to in self._backend.outgoing():
            if not self._lost and to == CABINET:
                self.cabinet.receive(answer, Source(FRI_LINK, CLIENT), now_ns=self._now_ns + 2 * LATENCY_NS)
        self._pass_period()
        return self._backend.read()

    def true_position_rad(self) -> Seven:
        """Where the Cabinet's arm is."""
        return self._arm.read().position_rad

    def lose_peer(self) -> None:
        """No datagram gets through any more."""
        self._lost = True

    def restore_peer(self) -> None:
        """Datagrams get through again."""
        self._lost = False

    def close(self) -> None:
        """Close the backend; and the Cabinet with its arm."""
        self._backend.close()
        self._arm.close()

    def _pass_period(self) -> None:
        cabinet = self.cabinet
        self._now_ns += cabinet.cycle_ns
        cabinet.tick(now_ns=self._now_ns)
        for outgoing in cabinet.outgoing():
            if not self._lost:
                self._backend.receive(outgoing.payload, CABINET, now_ns=self._now_ns + LATENCY_NS)
        cabinet.events()
        self._backend.advance(now_ns=self._now_ns + LATENCY_NS)

    def _make_cabinet(self, period_ns: int) -> Controller:
        fri = FriSettings(
            peer=CLIENT,
            send_period_ms=period_ns // _NS_PER_MS,
            quality_rise_ms=_QUALITY_RISE_MS,
            overlay_restart_ms=_OVERLAY_RESTART_MS,
        )
        settings = ControllerSettings(
            operation_mode=OperationMode.AUT, cycle_ms=period_ns // _NS_PER_MS, unix_epoch_ns=0, fri=fri, enabled=True
        )
        return Controller(
            settings,
            description=self._description,
            model=ArmModel(load_pinocchio(self._robot)),
            backend=self._arm,
            codec=FriCodec(self._release),
        )
