"""What the core is told at its construction: frozen, in base units, checked on construction."""

from dataclasses import dataclass, field
from typing import Final

from hil.values.arm import Capabilities
from hil.values.control import POSITION_CONTROL, ControlModeSettings, ControlSetup
from hil.values.errors import ConfigurationError, OutOfRange
from hil.values.frames import FrameTree
from hil.values.fri import MAX_PERIOD_MS, MIN_PERIOD_MS, TRAITS, ControlMode, OperationMode, OverlayKind, Release
from hil.values.link import Address
from hil.values.load import NO_LOAD, Load
from hil.values.signals import Signal, check_signals, check_transformation_names

NS_PER_MS = 1_000_000
CYCLE_CHOICES_MS = (1, 2, 4, 5)
MAX_REACTION_MS = 200.0
SMART_SERVO_ONSET_MS = 2.0
"""What a SmartServo's soft start and the arm take of the reaction time; a DirectServo moves the arm in its first cycle.

Measured with default parameters on the MuJoCo arm, to 1e-6 rad of the measured position (``hil bench reaction``).
"""


NEEDED_CONTROL: Final[dict[OverlayKind, ControlMode]] = {
    OverlayKind.TORQUE: ControlMode.JOINT_IMPEDANCE,
    OverlayKind.WRENCH: ControlMode.CARTESIAN_IMPEDANCE,
}
"""The one kind of control an overlay works under (fri-wire page); the others work under any."""
_CONTROL_NAMES: Final = {
    ControlMode.POSITION: "position control",
    ControlMode.JOINT_IMPEDANCE: "joint impedance control",
    ControlMode.CARTESIAN_IMPEDANCE: "Cartesian impedance control",
}


MAX_QUALITY_RISE_MS = 10_000


@dataclass(frozen=True, slots=True)
class FriSettings:
    """One FRI link.

    The latency budget is send period x receive multiplier (fri-wire page). Figures marked *ours* have no published
    value: the watchdog (longest run of unanswered messages while commanding), the number and the tolerance of the
    mirroring answers in COMMANDING_WAIT, and the rest between the end of an overlay and the next one. ``control`` is
    what the arm is controlled with while the client commands; else it is held stiffly.
    """

    peer: Address
    send_period_ms: int = 1
    receive_multiplier: int = 1
    overlay: OverlayKind = OverlayKind.JOINT_POSITION
    control: ControlModeSettings = POSITION_CONTROL
    watchdog_ms: int | None = None
    mirror_answers: int = 10
    mirror_tolerance_rad: float = 1e-3
    mirror_tolerance_mm: float = 1.0
    overlay_restart_ms: int = 1000
    transformations: tuple[str, ...] = ()
    """Names of those the client is asked for."""
    quality_rise_ms: int = 500
    """How long the figure must be better before the quality rises a level (fri-wire page, *ours*)."""
    first_sequence_counter: int = 0
    """Of the first message; a replay of a recording that began later goes on counting there."""

    def __post_init__(self) -> None:
        check_transformation_names(self.transformations)
        if not MIN_PERIOD_MS <= self.send_period_ms <= MAX_PERIOD_MS:
            raise ConfigurationError(
                f"send period {self.send_period_ms} ms is outside {MIN_PERIOD_MS}..{MAX_PERIOD_MS} ms"
            )
        if not 1 <= self.quality_rise_ms <= MAX_QUALITY_RISE_MS:
            raise ConfigurationError(
                f"quality rise time {self.quality_rise_ms} ms is outside 1..{MAX_QUALITY_RISE_MS} ms"
            )
        if self.receive_multiplier < 1:
            raise ConfigurationError(f"receive multiplier {self.receive_multiplier} is less than 1")
        if self.budget_ms > MAX_PERIOD_MS:
            raise ConfigurationError(
                f"send period {self.send_period_ms} ms x receive multiplier {self.receive_multiplier} = "
                f"{self.budget_ms} ms is more than {MAX_PERIOD_MS} ms"
            )
        if self.watchdog_ms is not None and not self.budget_ms <= self.watchdog_ms <= 1000:
            raise ConfigurationError(
                f"FRI watchdog {self.watchdog_ms} ms is outside {self.budget_ms}..1000 ms "
                f"(send period x receive multiplier .. one second)"
            )
        kind, needed = ControlSetup(self.control).kind, NEEDED_CONTROL.get(self.overlay)
        if needed is not None and kind is not needed:
            raise ConfigurationError(
                f"a {self.overlay} overlay needs {_CONTROL_NAMES[needed]}, not {_CONTROL_NAMES[kind]}"
            )

    def check_release(self, release: Release) -> None:
        """Raise :class:`ConfigurationError` if clients of ``release`` know no such overlay."""
        if self.overlay is OverlayKind.CARTESIAN_POSE and not TRAITS[release].pose:
            raise ConfigurationError(f"a {self.overlay} overlay needs a client of release 2.x, not {release}")

    def check_robot_side(self, capabilities: Capabilities) -> None:
        """Raise :class:`ConfigurationError` if the robot side cannot control the arm so."""
        setup = ControlSetup(self.control)
        if capabilities.takes_torque or self.overlay is OverlayKind.NONE:
            return
        if setup.yields and self.overlay not in capabilities.passes_overlays:
            raise ConfigurationError(
                f"a {self.overlay} overlay under {_CONTROL_NAMES[setup.kind]} needs a robot side that takes torques; "
                f"this one takes positions only"
            )

    @property
    def budget_ms(self) -> int:
        """Time a client has for its answer, and time between two answers."""
        return self.send_period_ms * self.receive_multiplier

    @property
    def budget_ns(self) -> int:
        """Latency budget in nanoseconds."""
        return self.budget_ms * NS_PER_MS

    @property
    def watchdog_ns(self) -> int:
        """Silence that ends a commanded motion: as set, or 50 ms, or three budgets where that is longer."""
        chosen = max(50, 3 * self.budget_ms) if self.watchdog_ms is None else self.watchdog_ms
        return chosen * NS_PER_MS


@dataclass(frozen=True, slots=True)
class ServoSettings:
    """One servo link; ``token_secret`` (at most 64 bytes, not empty) makes its session tokens."""

    software: str
    robot: str
    token_secret: bytes

    def __post_init__(self) -> None:
        if not 1 <= len(self.token_secret) <= 64:
            raise ConfigurationError(f"a token secret of {len(self.token_secret)} bytes; 1..64 are needed")


@dataclass(frozen=True, slots=True)
class ReactionSettings:
    """System reaction time: from the arrival of a destination to the effective motion (manual 1.3, 3.1.1, 7.12.2).

    All of it is dead time but :data:`SMART_SERVO_ONSET_MS`.
    """

    smart_servo_ms: float = 22.0
    direct_servo_ms: float = 12.0

    def __post_init__(self) -> None:
        for name, value_ms in (("SmartServo", self.smart_servo_ms), ("DirectServo", self.direct_servo_ms)):
            if not 0.0 <= value_ms <= MAX_REACTION_MS:
                raise ConfigurationError(
                    f"reaction time of {name} {value_ms:g} ms is outside 0..{MAX_REACTION_MS:g} ms"
                )

    @property
    def smart_servo_dead_time_ns(self) -> int:
        """Time a SmartServo destination waits before the interpolator has it."""
        return round(max(0.0, self.smart_servo_ms - SMART_SERVO_ONSET_MS) * NS_PER_MS)

    @property
    def direct_servo_dead_time_ns(self) -> int:
        """Time a DirectServo destination waits before the interpolator has it."""
        return round(self.direct_servo_ms * NS_PER_MS)


T1_SPEED_LIMIT_MM_S = 250.0
"""Of the flange in T1. Source: manual chapter 4."""
TRACKING_LIMIT_RAD = 0.1
"""Ours, no public figure: a little more than the 5 degrees that a DirectServo destination may be away."""


@dataclass(frozen=True, slots=True)
class SafetySettings:
    """What the monitors hold the arm to beside its axis limits; ``permissive``: they only report."""

    t1_flange_speed_mm_s: float = T1_SPEED_LIMIT_MM_S
    tracking_rad: float = TRACKING_LIMIT_RAD
    permissive: bool = False

    def __post_init__(self) -> None:
        for name, value, most in (
            ("flange speed in T1, mm/s", self.t1_flange_speed_mm_s, T1_SPEED_LIMIT_MM_S),
            ("tracking limit, rad", self.tracking_rad, TRACKING_LIMIT_RAD),
        ):
            if not 0.0 < value <= most:
                raise OutOfRange(name, value, f"> 0 and <= {most:g}")


IDEAL_REACTION = ReactionSettings(0.0, 0.0)
"""No dead time: a destination reaches the interpolator in the next cycle."""


@dataclass(frozen=True, slots=True)
class ControllerSettings:
    """One robot's controller; ``unix_epoch_ns`` is the Unix time of core time zero.

    ``enabled`` begins T1 and T2 with the enabling switch held and the start key pressed; in AUT nothing needs it.
    """

    operation_mode: OperationMode
    cycle_ms: int
    unix_epoch_ns: int
    fri: FriSettings | None
    servo: ServoSettings | None = None
    reaction: ReactionSettings = ReactionSettings()
    safety: SafetySettings = SafetySettings()
    enabled: bool = False
    frames: FrameTree = field(default_factory=FrameTree)
    load: Load = NO_LOAD
    """What hangs on the flange, in the flange, as far as anybody has told."""
    signals: tuple[Signal, ...] = ()

    def __post_init__(self) -> None:
        check_signals(self.signals)
        if self.cycle_ms not in CYCLE_CHOICES_MS:
            raise ConfigurationError(
                f"control cycle {self.cycle_ms} ms is none of {', '.join(map(str, CYCLE_CHOICES_MS))} ms"
            )
        if self.fri is not None and self.fri.send_period_ms % self.cycle_ms:
            raise ConfigurationError(
                f"send period {self.fri.send_period_ms} ms is no multiple of the control cycle of {self.cycle_ms} ms"
            )

    @property
    def cycle_ns(self) -> int:
        """Control cycle in nanoseconds."""
        return self.cycle_ms * NS_PER_MS
