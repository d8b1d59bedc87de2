"""What a recording from elsewhere says of the controller that was recorded: enough to put an emulator in its place.

Facts: fri-wire page. Releases 1.11 to 1.16 look the same on the wire but for inputs and outputs, which begin with 1.14.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from hil.config.control import ControlName
from hil.config.station import RobotConfig, parse_robot
from hil.values.errors import MalformedDatagram
from hil.values.fri import (
    ClientCommandMode,
    ControlMode,
    IODirection,
    IOType,
    OperationMode,
    OverlayKind,
    Release,
    SessionState,
)
from hil.values.fri_messages import IOValue, MonitoringMessage
from hil.values.link import Address
from hil.values.robot import JOINT_COUNT, Seven
from hil.values.signals import SignalValue
from transport.capture.records import Packet
from transport.fri import FriCodec

FRAMED: Final = Release.V2_7
_OVERLAYS: Final[Mapping[int, OverlayKind]] = {
    ClientCommandMode.JOINT_POSITION: OverlayKind.JOINT_POSITION,
    ClientCommandMode.WRENCH: OverlayKind.WRENCH,
    ClientCommandMode.TORQUE: OverlayKind.TORQUE,
    ClientCommandMode.CARTESIAN_POSE: OverlayKind.CARTESIAN_POSE,
}
_CONTROLS: Final[Mapping[int, ControlName]] = {
    ControlMode.POSITION: ControlName.POSITION,
    ControlMode.JOINT_IMPEDANCE: ControlName.JOINT_IMPEDANCE,
    ControlMode.CARTESIAN_IMPEDANCE: ControlName.CARTESIAN_IMPEDANCE,
}
DEFAULT_QUALITY_RISE_MS: Final = 500
_LARGEST_ANGLE_RAD: Final = 2 * math.pi


@dataclass(slots=True)
class Flow:
    """One recorded controller and its client, as far as the recording shows them."""

    controller: Address
    client: Address
    release: Release
    sure: bool
    """Whether the release is known, not only possible."""
    first: MonitoringMessage
    first_unix_ns: int
    command_mode: int | None = None
    control_mode: int | None = None
    ready_unix_ns: int | None = None
    """When the state was first better than MONITORING_WAIT."""
    notes: list[str] = field(default_factory=list)

    @property
    def initial_position_rad(self) -> Seven | None:
        """Where the arm was told to be at the start, or was."""
        monitor = self.first.monitor
        if monitor is None:
            return None
        position = monitor.commanded_position or monitor.measured_position
        if position is None or len(position) != JOINT_COUNT:
            return None
        # No arm is there, and MuJoCo would complain of it in a file of its own.
        if not all(abs(angle) <= _LARGEST_ANGLE_RAD for angle in position):
            return None
        a1, a2, a3, a4, a5, a6, a7 = position
        return (a1, a2, a3, a4, a5, a6, a7)

    def look(self, message: MonitoringMessage, at_unix_ns: int) -> None:
        """Learn from a later message."""
        if message.ipo is not None and message.ipo.client_command_mode:
            self.command_mode = message.ipo.client_command_mode
            if message.robot is not None:
                self.control_mode = message.robot.control_mode
        ready = message.connection is not None and message.connection.session_state > 1
        if ready and self.ready_unix_ns is None:
            self.ready_unix_ns = at_unix_ns

    @property
    def known(self) -> bool:
        """Whether later messages would teach nothing more."""
        return self.command_mode is not None and self.ready_unix_ns is not None

    def config(self, base: RobotConfig, *, backend: str | None) -> RobotConfig:
        """Return a robot's configuration that answers like the recorded one; raise ``ConfigurationError``."""
        fri: dict[str, Any] = {"client": str(self.client), "bind": f"{self.controller.host}:0", "release": self.release}
        connection = self.first.connection
        if connection is not None:
            fri["send_period_ms"] = connection.send_period_ms or 1
            fri["receive_multiplier"] = connection.receive_multiplier or 1
        overlay = OverlayKind.NONE if self.command_mode is None else _OVERLAYS.get(self.command_mode)
        fri["overlay"] = overlay or OverlayKind.NONE
        control = None if self.control_mode is None else _CONTROLS.get(self.control_mode)
        if control is not None and overlay is not OverlayKind.NONE:
            own = base.fri.control if base.fri is not None and base.fri.control.mode is control else None
            fri["control"] = {"mode": control} if own is None else own.model_dump(exclude_unset=True)
        if base.fri is not None and base.fri.watchdog_ms is not None:
            fri["watchdog_ms"] = base.fri.watchdog_ms
        fri["transformations"] = tuple(one.name for one in self.first.requested_transformations)
        fri["quality_rise_ms"] = self._quality_rise_ms()
        robot = self.first.robot
        told: dict[str, Any] = {**base.model_dump(exclude_unset=True), "fri": fri, "servo": None, "enabled": True}
        told["io"] = self._groups() or told.get("io", ())
        if robot is not None and robot.operation_mode in set(OperationMode):
            told["mode"] = OperationMode(robot.operation_mode).name
        if backend is not None:
            told["backend"] = backend
        return parse_robot(told, where=f"no emulator can be what the controller at {self.controller} says it is")

    def _quality_rise_ms(self) -> int:
        """Return how long the recorded quality took for a step: it rises two before the state may be READY."""
        if self.ready_unix_ns is None:
            return DEFAULT_QUALITY_RISE_MS
        return max(1, min(DEFAULT_QUALITY_RISE_MS, (self.ready_unix_ns - self.first_unix_ns) // 2_000_000))

    def _groups(self) -> tuple[dict[str, Any], ...]:
        monitor = self.first.monitor
        groups: dict[str, list[dict[str, Any]]] = {}
        for value in () if monitor is None else monitor.inputs_outputs:
            if value.type not in set(IOType) or value.direction not in set(IODirection):
                continue
            group, _, name = value.name.partition(".")
            groups.setdefault(group, []).append(
                {
                    "name": name,
                    "type": IOType(value.type).name.lower(),
                    "direction": IODirection(value.direction).name.lower(),
                    "initial": value_of(value),
                }
            )
        return tuple({"name": name, "signal": tuple(signals)} for name, signals in groups.items())


def state_of(message: MonitoringMessage) -> SessionState | None:
    """Return the session state of a message, IDLE where it tells none; None for a number that is no state."""
    number = 0 if message.connection is None else message.connection.session_state
    return SessionState(number) if number in set(SessionState) else None


def value_of(value: IOValue) -> SignalValue:
    """Return what an input or output is."""
    if value.type == IOType.ANALOG:
        return float(value.analog or 0.0)
    return bool(value.digital) if value.type == IOType.BOOLEAN else int(value.digital or 0)


def flow_of(packet: Packet, release: Release | None) -> Flow | None:
    """Return the flow that begins with ``packet``; None where that is no monitoring message of any release."""
    found = _decoded(packet.payload)
    if found is None:
        return None
    message, possible, sure = found
    notes = []
    if release is not None:
        if (release is FRAMED) is not (possible is FRAMED):
            notes.append(f"the datagrams are those of release {possible}, not {release}, which was asked for")
        else:
            possible, sure = release, True
    if not sure:
        notes.append(
            f"releases 1.11, 1.14, 1.15 and 1.16 look the same here: {possible} is taken; --fri-version chooses another"
        )
    controller, client = Address(*packet.source), Address(*packet.destination)
    return Flow(controller, client, possible, sure, message, packet.at_unix_ns, notes=notes)


def _decoded(payload: bytes) -> tuple[MonitoringMessage, Release, bool] | None:
    for release in (FRAMED, Release.V1_15):
        try:
            message = FriCodec(release).decode_monitoring(payload)
        except MalformedDatagram:
            continue
        if release is FRAMED:
            return message, release, True
        monitor = message.monitor
        if monitor is not None and (monitor.measured_pose is not None or monitor.redundancy is not None):
            return message, Release.V2_5, True
        return message, release, False
    return None
