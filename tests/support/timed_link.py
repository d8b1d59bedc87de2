"""A real controller and a socket to it in virtual time, with delays, losses and late cycles as a test says."""

import heapq
import itertools
from collections.abc import Callable
from functools import partial
from typing import Any

from hil.clock import VirtualClock, using
from hil.core.servo.link import SERVO_LINK
from hil.values.finding import Diagnosis
from hil.values.link import Address, Source
from tests.support.servo_virtual import ServoBench
from tools.doctor.udp.figures import LinkFigures, figures
from tools.doctor.udp.measure import watch
from tools.doctor.udp.opening import join
from tools.doctor.udp.stamped import Heard
from tools.doctor.udp.verdict import judge

US = 1000
MS = 1_000_000
DOCTOR = Address("127.0.0.1", 40009)
CONTROLLER = Address("192.0.2.1", 30300)
Delay = Callable[[int], int | None]
"""Of the n-th datagram of a direction, in ns; None: lost."""


def wire(_number: int) -> int:
    """A good cable."""
    return 50 * US


def in_time(_number: int) -> int:
    """Nothing is late."""
    return 20 * US


class TimedLink:
    """A :class:`tools.doctor.udp.stamped.TimedSocket` to a controller that runs as time passes in :meth:`receive`."""

    def __init__(
        self,
        *,
        up: Delay = wire,
        down: Delay = wire,
        cycle_late: Callable[[int], int] = in_time,
        read_late: Callable[[int], int] = in_time,
        drift: float = 0.0,
        **bench: Any,
    ) -> None:
        self.peer = CONTROLLER
        self.dropped: int | None = 0
        self.clock = VirtualClock(7_000_000_000)
        self.bench = ServoBench(**bench)
        self._up, self._down, self._cycle_late, self._read_late = up, down, cycle_late, read_late
        self._rate = 1.0 + drift
        self._epoch_ns = self.clock.now_ns()
        self._order = itertools.count()
        self._events: list[tuple[int, int, Callable[[int], None]]] = []
        self._heard: list[tuple[int, bytes]] = []
        self._ups, self._downs, self._reads = itertools.count(), itertools.count(), itertools.count()
        self._cycle = -1
        self._busy_until_ns = 0
        self._next_cycle()

    def send(self, datagram: bytes) -> bool:
        """Send to the controller."""
        delay_ns = self._up(next(self._ups))
        if delay_ns is not None:
            self._at(self.clock.now_ns() + delay_ns, lambda at_ns: self._arrive(datagram, at_ns))
        return True

    def receive(self, within_s: float) -> Heard | None:
        """Let time pass until something comes."""
        until_ns = self.clock.now_ns() + round(within_s * 1e9)
        while not self._heard and self._events and self._events[0][0] <= until_ns:
            at_ns, _, action = heapq.heappop(self._events)
            self.clock.advance(max(0, at_ns - self.clock.now_ns()))
            action(at_ns)
        if not self._heard:
            self.clock.advance(max(0, until_ns - self.clock.now_ns()))
            return None
        arrived_ns, datagram = self._heard.pop(0)
        self.clock.advance(self._read_late(next(self._reads)))
        return Heard(datagram, arrived_ns, self.clock.now_ns() - arrived_ns)

    def _at(self, at_ns: int, action: Callable[[int], None]) -> None:
        heapq.heappush(self._events, (at_ns, next(self._order), action))

    def _core_ns(self, at_ns: int) -> int:
        return round((at_ns - self._epoch_ns) * self._rate)

    def _next_cycle(self) -> None:
        self._cycle += 1
        due_ns = self._epoch_ns + round(self._cycle * self.bench.settings.cycle_ns / self._rate)
        begins_ns = max(due_ns + self._cycle_late(self._cycle), self._busy_until_ns)
        self._busy_until_ns = begins_ns + 50 * US
        self._at(begins_ns, lambda at_ns: self._run_cycle(at_ns, at_ns - due_ns))

    def _run_cycle(self, at_ns: int, lateness_ns: int) -> None:
        core, cycle_ns = self.bench.controller, self.bench.settings.cycle_ns
        core.tick(now_ns=self._cycle * cycle_ns, lateness_ns=lateness_ns)
        for link, payload, _ in core.outgoing(now_ns=self._core_ns(at_ns)):
            delay_ns = self._down(next(self._downs)) if link == SERVO_LINK else None
            if delay_ns is not None:
                self._at(at_ns + delay_ns, partial(self._deliver, payload))
        self._next_cycle()

    def _arrive(self, datagram: bytes, at_ns: int) -> None:
        self.bench.controller.receive(datagram, Source(SERVO_LINK, DOCTOR), now_ns=self._core_ns(at_ns))

    def _deliver(self, payload: bytes, at_ns: int) -> None:
        self._heard.append((at_ns, payload))


def measured(link: TimedLink, *, seconds: float = 1.0, period_ms: int | None = None) -> LinkFigures:
    """Measure through ``link`` as ``hil doctor udp`` does."""
    with using(link.clock):
        joined = join(link, link.bench.codec, period_ms=period_ms, has_key=False, within_s=3.0)
        tally = watch(link, link.bench.codec, joined, seconds=seconds, clock=link.clock, progress=lambda _: None)
    return figures(tally, joined.welcome, period_ms=joined.period_ms, unix_minus_clock_ns=0)


def diagnosed(link: TimedLink, *, seconds: float = 1.0, same_machine: bool = False) -> Diagnosis:
    """Diagnose ``link``."""
    return judge(measured(link, seconds=seconds), controller=CONTROLLER, same_machine=same_machine)
