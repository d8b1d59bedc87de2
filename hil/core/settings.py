"""What the core is told at its construction: frozen, in base units, checked on construction."""

from dataclasses import dataclass

from hil.values.errors import ConfigurationError
from hil.values.fri import MAX_PERIOD_MS, MIN_PERIOD_MS, OperationMode
from hil.values.link import Address

NS_PER_MS = 1_000_000
CYCLE_CHOICES_MS = (1, 2, 4, 5)


@dataclass(frozen=True, slots=True)
class FriSettings:
    """One FRI link.

    The latency budget is send period x receive multiplier (fri-wire page). Figures marked *ours* have no published
    value: the watchdog (longest run of unanswered messages while commanding), the number and the tolerance of the
    mirroring answers in COMMANDING_WAIT, and the rest between the end of an overlay and the next one.
    """

    peer: Address
    send_period_ms: int = 1
    receive_multiplier: int = 1
    joint_position_overlay: bool = True
    watchdog_ms: int | None = None
    mirror_answers: int = 10
    mirror_tolerance_rad: float = 1e-3
    overlay_restart_ms: int = 1000

    def __post_init__(self) -> None:
        if not MIN_PERIOD_MS <= self.send_period_ms <= MAX_PERIOD_MS:
            raise ConfigurationError(
                f"send period {self.send_period_ms} ms is outside {MIN_PERIOD_MS}..{MAX_PERIOD_MS} ms"
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
class ControllerSettings:
    """One robot's controller; ``unix_epoch_ns`` is the Unix time of core time zero."""

    operation_mode: OperationMode
    cycle_ms: int
    unix_epoch_ns: int
    fri: FriSettings | None

    def __post_init__(self) -> None:
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
