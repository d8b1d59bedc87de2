"""The command stream that two robot sides get: set points of the real planner, and what else can be done to them."""

import math
from collections.abc import Sequence
from enum import StrEnum
from itertools import cycle
from pathlib import Path
from typing import Final, NamedTuple

from hil.config.station import Reaction, ReactionConfig, RobotConfig, ServoConfig
from hil.core.controller import Controller
from hil.runtime.assembly import RobotParts
from hil.runtime.capture_header import RobotStart
from hil.values.arm import JointCommand, seven
from hil.values.errors import ConfigurationError
from hil.values.motion import MotionKind, MotionParameters
from hil.values.robot import JOINT_COUNT, Seven
from hil.values.servo import SetDestination, StartMotion, StopMotion
from tools.bench.servo_virtual import VirtualApplication

_STILL: Final[Seven] = (0.0,) * JOINT_COUNT  # type: ignore[assignment]
_REST_S: Final = 0.2
_PTP_RAD: Final[Seven] = (0.3, -0.25, 0.2, -0.3, 0.25, -0.3, 0.4)
_SWING_RAD: Final[Seven] = (0.12, 0.06, 0.0, 0.1, 0.0, 0.08, 0.15)
_SERVO_S: Final = 1.2
_FREQUENCY_HZ: Final = 1.0
_SMART_SERVO_MS: Final = (20, 10, 40, 20, 5, 25)
"""Between destinations; some come early, some late."""
_DIRECT_SERVO_MS: Final = 5
_DIRECT_SERVO_RAD: Final = 0.03
_DRIVES_OFF_S: Final = 0.3
_DRIVES_BACK_S: Final = 0.8
_PUSH_S: Final = 0.6


class Action(StrEnum):
    """What is done to a robot side beside commanding it."""

    NONE = ""
    DRIVES_OFF = "drives off"
    DRIVES_ON = "drives on"
    PUSH = "push"


class Moment(NamedTuple):
    """One cycle: what is done first, what is commanded, and what that is part of."""

    part: str
    command: JointCommand
    action: Action = Action.NONE


class _Recorder(VirtualApplication):
    """An application of an ideal arm, whose set points are kept."""

    def __init__(self, config: RobotConfig) -> None:
        self.part = "rest"
        self.moments: list[Moment] = []
        super().__init__(config)

    def cycle(self) -> None:
        """One control cycle, and its set point."""
        super().cycle()
        self.moments.append(Moment(self.part, JointCommand(*self.controller.motion.set_point)))


def planned_stream(*, robot: str, cycle_ms: int) -> list[Moment]:
    """Return a mix of what applications do: PTP, SmartServo with a stop from speed, DirectServo, rest."""
    config = RobotConfig(
        model=robot,
        backend="ideal",
        cycle_ms=cycle_ms,
        servo=ServoConfig(),
        reaction=ReactionConfig(profile=Reaction.IDEAL),
    )
    with _Recorder(config) as application:
        start = application.arm.position_rad
        application.run(_REST_S)
        _move_ptp(application, seven([here + by for here, by in zip(start, _PTP_RAD, strict=True)]))
        _swing(application, MotionKind.SMART_SERVO, _SWING_RAD, periods_ms=_SMART_SERVO_MS, cycle_ms=cycle_ms)
        small = seven([_DIRECT_SERVO_RAD if swing else 0.0 for swing in _SWING_RAD])
        _swing(application, MotionKind.DIRECT_SERVO, small, periods_ms=(_DIRECT_SERVO_MS,), cycle_ms=cycle_ms)
        _move_ptp(application, start)
        application.part = "rest"
        application.run(_REST_S)
        return application.moments


def with_actions(stream: Sequence[Moment], *, cycle_ms: int, drives: bool, push: bool) -> list[Moment]:
    """Return a stream with a drop of the drives and a push behind it, where both robot sides can have them."""
    whole = list(stream)
    hold = JointCommand(stream[-1].command.position_rad, _STILL)
    for wanted, action, seconds in (
        (drives, Action.DRIVES_OFF, _DRIVES_OFF_S),
        (drives, Action.DRIVES_ON, _DRIVES_BACK_S),
        (push, Action.PUSH, _PUSH_S),
    ):
        if wanted:
            whole.append(Moment(action.value, hold, action))
            whole += [Moment(action.value, hold)] * (round(seconds * 1e3) // cycle_ms - 1)
    return whole


def captured_stream(capture: Path) -> tuple[str, int, list[Moment]]:
    """Return robot model, control cycle in ms and set points of one of our recordings, by its exact replay.

    Raises :class:`ConfigurationError` for a recording that is none of ours, has several robots, or yields: the torques
    of a control law answer what one arm measured, and are no stream for another.
    """
    from hil.replay.replay import own_header, replay_own

    header = own_header(capture)
    if header is None or len(header.robots) != 1:
        raise ConfigurationError(
            f"{capture} is no recording of one of our controllers with one robot, from its start on"
        )
    config = header.config(0)
    moments: list[Moment] = []

    class _Observer:
        def __init__(self, controller: Controller) -> None:
            self._controller = controller

        def cycle(self, now_ns: int) -> None:
            if self._controller.motion.control.yields:
                raise ConfigurationError(
                    f"{capture}: its arm is under impedance control at {now_ns * 1e-9:.3f} s; the torques of that "
                    "answer what it measured, so only recordings under position control are given to two robot sides"
                )
            moments.append(
                Moment(self._controller.motion.phase.value, JointCommand(*self._controller.motion.set_point))
            )

    def observe(_start: RobotStart, _config: RobotConfig, _parts: RobotParts, controller: Controller) -> _Observer:
        return _Observer(controller)

    replay_own(capture, header, observe=observe)
    if not moments:
        raise ConfigurationError(f"{capture} holds no control cycle")
    return config.model, config.cycle_ms, moments


def _move_ptp(application: _Recorder, destination: Seven) -> None:
    application.part = "PTP"
    motion = application.ask(
        lambda number: StartMotion(number, MotionKind.PTP, MotionParameters(joint_velocity_rel=0.6), destination)
    ).request
    while any(state.motion == motion for state in application.snapshot.motions):
        application.cycle()


def _swing(
    application: _Recorder, kind: MotionKind, swing_rad: Seven, *, periods_ms: tuple[int, ...], cycle_ms: int
) -> None:
    application.part = kind.manual_name
    start = application.snapshot.commanded_position
    motion = application.ask(lambda number: StartMotion(number, kind, MotionParameters(), None)).request
    swung_ms, periods = 0, cycle(periods_ms)
    while swung_ms < _SERVO_S * 1e3:
        swing = math.sin(2.0 * math.pi * _FREQUENCY_HZ * swung_ms * 1e-3)
        there = seven([here + by * swing for here, by in zip(start, swing_rad, strict=True)])
        application.ask(lambda number, there=there: SetDestination(number, motion, there))  # type: ignore[misc]
        cycles = max(1, next(periods) // cycle_ms)
        for _ in range(cycles - 1):
            application.cycle()
        swung_ms += cycles * cycle_ms
    application.part = f"stop of {kind.manual_name}"
    application.ask(lambda number: StopMotion(number, motion))
    while any(state.motion == motion for state in application.snapshot.motions):
        application.cycle()
    application.run(_REST_S)
