"""The door of the servo link: which hello gets an offer, and which one is told why not.

Nobody who is not a client gets anything but an answer to a well-formed hello, and that is never longer than the hello.
"""

from collections.abc import Callable

from hil.core.servo.sessions import MAX_OBSERVERS, SessionTable
from hil.core.settings import ServoSettings
from hil.values.link import Address
from hil.values.servo import (
    MAX_STATE_PERIOD_MS,
    MAX_WATCHDOG_MS,
    MIN_STATE_PERIOD_MS,
    MIN_WATCHDOG_MS,
    PROTOCOL_VERSION,
    Hello,
    Refused,
    Role,
    Welcome,
)


class Door:
    """Answers hellos; ``barred`` says why no session may begin now, empty when one may."""

    def __init__(
        self,
        *,
        settings: ServoSettings,
        sessions: SessionTable,
        cycle_ms: int,
        unix_epoch_ns: int,
        barred: Callable[[], str],
    ) -> None:
        self._settings = settings
        self._sessions = sessions
        self._cycle_ms = cycle_ms
        self._unix_epoch_ns = unix_epoch_ns
        self._barred = barred

    def answer(self, hello: Hello, sender: Address, *, now_ns: int) -> Welcome | Refused:
        """Return an offer for the hello of ``sender``, or the reason why there is none."""
        reason = self._never_because(hello)
        if reason:
            return Refused(PROTOCOL_VERSION, hello.nonce, reason, try_again=False)
        reason = self.not_now_because(hello.role, now_ns=now_ns)
        if reason:
            return Refused(PROTOCOL_VERSION, hello.nonce, reason, try_again=True)
        session = self._sessions.offer(hello, sender, now_ns=now_ns)
        return Welcome(
            PROTOCOL_VERSION,
            hello.nonce,
            session.token,
            self._settings.software,
            self._settings.robot,
            self._cycle_ms,
            self._unix_epoch_ns,
        )

    def not_now_because(self, role: Role, *, now_ns: int) -> str:
        """Return why no session of ``role`` may begin now; empty when one may."""
        if barred := self._barred():
            return barred
        commander = self._sessions.commander
        if role is Role.COMMANDER and commander is not None:
            return (
                f"the arm is commanded by {commander}, heard {commander.silent_ns(now_ns=now_ns) / 1e6:.0f} ms ago; "
                f"it loses the arm after {commander.watchdog_ns / 1e6:g} ms of silence"
            )
        if role is not Role.COMMANDER and self._sessions.observers >= MAX_OBSERVERS:
            return f"{MAX_OBSERVERS} observers watch already, no more are served"
        return ""

    def _never_because(self, hello: Hello) -> str:
        if hello.version != PROTOCOL_VERSION:
            return (
                f"the application speaks version {hello.version} of the servo link, this controller "
                f"({self._settings.software}) version {PROTOCOL_VERSION}: install the same fri-hil on both sides"
            )
        if not MIN_STATE_PERIOD_MS <= hello.state_period_ms <= MAX_STATE_PERIOD_MS:
            return f"state period {hello.state_period_ms} ms is outside {MIN_STATE_PERIOD_MS}..{MAX_STATE_PERIOD_MS} ms"
        # What is no multiple of the control cycle is as long as the next one.
        state_period_ms = -(-hello.state_period_ms // self._cycle_ms) * self._cycle_ms
        lowest_ms = max(MIN_WATCHDOG_MS, 3 * state_period_ms)
        if not lowest_ms <= hello.watchdog_ms <= MAX_WATCHDOG_MS:
            return (
                f"watchdog {hello.watchdog_ms} ms is outside {lowest_ms}..{MAX_WATCHDOG_MS} ms "
                f"(at least {MIN_WATCHDOG_MS} ms and three state periods)"
            )
        if hello.latency_budget_ms and not 3 * state_period_ms <= hello.latency_budget_ms <= hello.watchdog_ms:
            return (
                f"latency budget {hello.latency_budget_ms} ms is outside {3 * state_period_ms}.."
                f"{hello.watchdog_ms} ms (three state periods .. watchdog)"
            )
        return ""
