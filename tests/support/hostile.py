"""A controller with both links, clients that mean it harm and an operator who presses anything; and the laws that hold.

One seed, one story: the same seed does the same every time.
"""

import math
import random
from collections.abc import Callable
from typing import Final

from backends.robots import load_pinocchio
from hil.core.controller import FRI_LINK
from hil.core.model import ArmModel
from hil.core.settings import FriSettings
from hil.values.fri import OperationMode, Release
from hil.values.fri_messages import CommandData, CommandMessage, MonitoringMessage
from hil.values.link import Address, Source
from hil.values.motion import MotionKind, MotionParameters
from hil.values.operator import PadKey, Press, ProgramState, SelectMode, SetOverride
from hil.values.servo import (
    Request,
    SetDestination,
    SetRuntimeParameters,
    StartMotion,
    StopMotion,
    Vector,
)
from tests.support.laws import Laws
from tests.support.servo_virtual import COMMANDER, OTHER, Application, ServoBench
from tests.support.virtual import PEER, SOURCE, Client, RecordingBackend
from transport.fri import FriCodec

_NUMBERS: Final = (0.0, 1e-300, -1e308, math.nan, math.inf, -math.inf, 3.0, -3.0, 1e-9)
_FACTORS: Final = (0.0, 1e-12, 0.1, 0.5, 1.0, 20.0, math.nan, 1e9)
_MODEL_OF: Final[dict[str, ArmModel]] = {}


class Hostile:
    """A story of a hostile world, told cycle by cycle; :meth:`check` holds the laws against what reached the arm."""

    def __init__(self, seed: int, *, mode: OperationMode, robot: str = "lbr-iiwa-14-r820", fri: bool = True) -> None:
        self.random = random.Random(seed)
        settings = FriSettings(peer=PEER, overlay_restart_ms=20) if fri else None
        self.bench = ServoBench(robot=robot, mode=mode, fri=settings)
        self.model = _MODEL_OF.setdefault(robot, ArmModel(load_pinocchio(robot)))
        self.limits = self.bench.description.limits
        self.client = Client(FriCodec(Release.V1_15), amplitude_rad=0.0)
        self.client.change = self._spoilt
        self.application = Application(self.bench, watchdog_ms=100)
        self._laws = Laws(self.limits, self.model)
        self._drift = [0.0] * 7
        self._drift_speed = [0.0] * 7
        self._quiet_until = 0
        self._cycle = 0
        self._fri_heard = 0

    def run(self, cycles: int) -> None:
        """Let so many cycles pass in which anything may happen."""
        for _ in range(cycles):
            if self.random.random() < 0.2:
                self.random.choice(
                    (
                        self.servo_request,
                        self.servo_request,
                        self.fri_turn,
                        self.fri_turn,
                        self.noise,
                        self.comes_or_goes,
                    )
                )()
            if self.random.random() < 0.015:
                self.operator_acts()
            self.cycle()

    def cycle(self) -> None:
        """One control cycle of both links, and the laws."""
        if self.application.token == 0:
            self.application.take_up()
        elif self._cycle >= self._quiet_until:
            self.application.command()
        self.bench.cycle()
        self._cycle += 1
        for datagram in self.bench.fri_sent[self._fri_heard :]:
            answer = self.client.answer(datagram)
            if answer is not None:
                self.bench.controller.receive(answer, SOURCE, now_ns=self.bench.now_ns + 200_000)
        self._fri_heard = len(self.bench.fri_sent)
        self.check()

    def until_commanding(self) -> None:
        """Let an honest FRI client get the arm."""
        fri = self.bench.controller.fri
        assert fri is not None
        for _ in range(1600):
            self.cycle()
            if fri.commanding:
                return
        raise AssertionError(fri.log.refused[-1])

    def servo_request(self) -> None:
        """An application asks for something, sensible or not."""
        if not self.application.token:
            self.application.knock()
            return
        self.application.number += 1
        self.application.command(self._request(self.application.number))

    def fri_turn(self) -> None:
        """The FRI client changes how fast it drifts, as far as it is allowed to and beyond."""
        axis = self.random.randrange(7)
        self._drift_speed[axis] = self.random.uniform(-1.02, 1.02) * self.limits.velocity_rad_s[axis]
        if self.random.random() < 0.3:
            self._drift_speed = [0.0] * 7

    def noise(self) -> None:
        """Bytes from anybody: broken ones, old ones, strangers'."""
        choice = self.random
        sources = (SOURCE, Source(FRI_LINK, OTHER), Source("servo", COMMANDER), Source("servo", OTHER))
        source = choice.choice((*sources, Source("nowhere", Address("127.0.0.1", 1))))
        known = self.client.said or [b""]
        payload = bytearray(choice.choice((bytes(known[-1]), bytes(known[0]), choice.randbytes(choice.randrange(90)))))
        if payload and choice.random() < 0.7:
            payload[choice.randrange(len(payload))] ^= 1 << choice.randrange(8)
        self.bench.controller.receive(bytes(payload), source, now_ns=max(self.bench.now_ns, 0))

    def comes_or_goes(self) -> None:
        """An application falls silent for a while, leaves, or joins again; or the FRI client does."""
        what = self.random.randrange(5)
        if what == 0:
            self._quiet_until = self._cycle + self.random.randrange(300)
        elif what == 1 and self.application.token:
            self.application.goodbye()
        elif what == 2:
            self.application = Application(self.bench, watchdog_ms=100, nonce=self.random.getrandbits(64))
            self.application.knock()
        elif what == 3:
            gap = self.client.received + self.random.randrange(120)
            self.client.answers = lambda count: count > gap
        else:
            self.client.sequence = 0

    def operator_acts(self) -> None:
        """The operator presses anything, but mostly what lets the arm move again."""
        controller, now_ns = self.bench.controller, max(self.bench.now_ns, 0)
        what = self.random.randrange(8)
        if what == 0:
            controller.operate(SelectMode(self.random.choice(list(OperationMode))), now_ns=now_ns)
        elif what == 1:
            controller.operate(SetOverride(self.random.choice((0.0, 3.0, 50.0, 100.0, 101.0, math.nan))), now_ns=now_ns)
        elif what == 2:
            controller.operate(Press(self.random.choice(list(PadKey))), now_ns=now_ns)
        else:
            for key in (PadKey.RESET, PadKey.ENABLE, PadKey.START):
                controller.operate(Press(key), now_ns=now_ns)

    def check(self) -> None:
        """Hold the laws against everything that reached the arm since the last time."""
        arm = self.bench.backend
        assert isinstance(arm, RecordingBackend)
        controller = self.bench.controller
        monitors = controller._safety.monitors
        for command in arm.commands:
            self._laws.check(command, t1=monitors.t1, running=controller.operator.program is ProgramState.RUNNING)
        arm.commands.clear()

    @property
    def told_to_move(self) -> int:
        """How many commands moved the arm."""
        return self._laws.moved

    def _spoilt(self, command: CommandMessage, _message: MonitoringMessage) -> CommandMessage:
        data = command.command
        if data is None or data.position is None:
            return command
        for axis in range(7):
            self._drift[axis] += self._drift_speed[axis] * 1e-3
        position = [value + moved for value, moved in zip(data.position, self._drift, strict=True)]
        if self.random.random() < 0.002:
            axis = self.random.randrange(7)
            position[axis] = self.random.choice((*_NUMBERS, position[axis] + self.random.uniform(-0.1, 0.1)))
            position = position[: self.random.choice((6, 7, 7, 7))]
        if self.random.random() < 0.002:
            self._drift = [0.0] * 7
        return command._replace(command=CommandData(position=tuple(position)))

    def _vector(self) -> Vector | None:
        what = self.random.randrange(10)
        low, high = self.limits.position_min_rad, self.limits.position_max_rad
        if what < 4:
            return tuple(self.random.uniform(a, b) for a, b in zip(low, high, strict=True))
        if what < 7:
            here = self.bench.controller.motion.set_point.position_rad
            return tuple(value + self.random.uniform(-0.08, 0.08) for value in here)
        if what == 7:
            return tuple(self.random.choice((a, b)) for a, b in zip(low, high, strict=True))
        if what == 8:
            return tuple(self.random.choice(_NUMBERS) for _ in range(self.random.choice((0, 6, 7, 7, 8))))
        return None

    def _parameters(self) -> MotionParameters:
        choose: Callable[[tuple[float, ...]], float] = self.random.choice
        if self.random.random() < 0.6:
            return MotionParameters(
                acceleration_override=choose((1.0, 20.0)), joint_jerk_percent=choose((100.0, 1500.0))
            )
        return MotionParameters(
            joint_velocity_rel=choose(_FACTORS),
            joint_acceleration_rel=choose(_FACTORS),
            acceleration_override=choose(_FACTORS),
            joint_jerk_percent=choose((*_FACTORS, 1500.0)),
            minimum_execution_time_s=choose((0.0, 0.01, 5.0, math.inf, -1.0)),
            speed_timeout_s=choose((0.0, 0.3, math.inf)),
            timeout_after_goal_s=choose((0.0, 0.3, 120.0, math.nan)),
            blending_rel=choose((0.0, 0.5, 1.0)),
            velocity_planning=self.random.random() < 0.5,
            wait_for_pause=self.random.random() < 0.5,
        )

    def _request(self, number: int) -> Request:
        motion = max(0, number - self.random.randrange(1, 6))
        what = self.random.randrange(9)
        if what < 3:
            return StartMotion(number, self.random.choice(list(MotionKind)), self._parameters(), self._vector())
        if what < 7:
            velocity = self._vector() if self.random.random() < 0.2 else None
            return SetDestination(number, motion, self._vector(), velocity)
        if what == 7:
            return SetRuntimeParameters(number, motion, self.random.choice((None, 0.0, 2.0, math.nan)), None, None)
        return StopMotion(number, motion)
