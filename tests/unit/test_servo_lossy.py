"""Both ends of the servo link over a channel that loses, repeats and overtakes, seeded: only time is lost."""

import heapq
import itertools
import random
from functools import partial

import pytest

from hil.client.servo.session import ServoSession
from hil.core.servo.link import SERVO_LINK
from hil.values.link import Address, Source
from hil.values.motion import MotionEnd, MotionKind, MotionParameters
from hil.values.servo import (
    MotionEnded,
    RequestError,
    Role,
    SetDestination,
    SetRuntimeParameters,
    StartMotion,
    StopMotion,
)
from tests.support.servo_virtual import MS, ServoBench, offset
from transport.servo import ServoCodec

CLIENT = Address("127.0.0.1", 40100)


class Channel:
    """Carries datagrams one way; some get lost, some come twice, some are overtaken."""

    def __init__(self, seed: int, *, loss: float, repeat: float, latest_ms: float) -> None:
        self._random = random.Random(seed)
        self._loss, self._repeat, self._latest_ms = loss, repeat, latest_ms
        self._on_the_way: list[tuple[int, int, bytes]] = []
        self._order = itertools.count()
        self.lost = self.repeated = 0

    def put(self, datagram: bytes, *, now_ns: int) -> None:
        """Send a datagram."""
        copies = 1
        if self._random.random() < self._loss:
            self.lost += 1
            copies = 0
        elif self._random.random() < self._repeat:
            self.repeated += 1
            copies = 2
        for _ in range(copies):
            at_ns = now_ns + round(self._random.uniform(0.1, self._latest_ms) * MS)
            heapq.heappush(self._on_the_way, (at_ns, next(self._order), datagram))

    def due(self, *, now_ns: int) -> list[bytes]:
        """Return what arrives by ``now_ns``."""
        arrived = []
        while self._on_the_way and self._on_the_way[0][0] <= now_ns:
            arrived.append(heapq.heappop(self._on_the_way)[2])
        return arrived


class Pair:
    """A controller and a client session joined by two channels."""

    def __init__(self, seed: int, *, loss: float = 0.3, repeat: float = 0.2, latest_ms: float = 8.0) -> None:
        self.bench = ServoBench()
        self.session = ServoSession(
            ServoCodec(), role=Role.COMMANDER, watchdog_ms=400, state_period_ms=5, name="lossy", nonce=seed
        )
        self.there = Channel(2 * seed, loss=loss, repeat=repeat, latest_ms=latest_ms)
        self.back = Channel(2 * seed + 1, loss=loss, repeat=repeat, latest_ms=latest_ms)

    def run_until(self, condition: object, *, at_most_s: float = 60.0) -> None:
        """Let time pass until ``condition()`` holds; fail if it does not."""
        for _ in range(round(at_most_s * 1000)):
            if condition():  # type: ignore[operator]
                return
            self.cycle()
        raise AssertionError(f"did not happen; {self.session.phase}, {self.bench.told()[-5:]}")

    def cycle(self) -> None:
        """One millisecond of both ends."""
        bench, session = self.bench, self.session
        now_ns = bench.now_ns + MS
        for datagram in self.there.due(now_ns=now_ns):
            bench.controller.receive(datagram, Source(SERVO_LINK, CLIENT), now_ns=now_ns)
        bench.now_ns = now_ns
        bench.controller.tick(now_ns=now_ns)
        for out in bench.controller.outgoing():
            self.back.put(out.payload, now_ns=now_ns)
        bench.events += bench.controller.events()
        for datagram in self.back.due(now_ns=now_ns):
            session.receive(datagram)
        if not session.running and bench.controller.ticks % 20 == 0:
            session.knock()
        elif bench.controller.ticks % 20 == 0:
            session.keep_alive()
        while (datagram_out := session.outgoing()) is not None:
            self.there.put(datagram_out, now_ns=now_ns)


def play(pair: Pair) -> list[object]:
    """Run a programme of motions; return every outcome that does not depend on time."""
    session = pair.session
    outcomes: list[object] = []
    start = pair.bench.description.initial_position_rad
    pair.run_until(lambda: session.running)

    def ask(make: object) -> int:
        pending = session.ask(make)  # type: ignore[arg-type]
        pair.run_until(lambda: pending.done is not None)
        assert pending.done is not None
        outcomes.append((type(pending.request).__name__, pending.done.error, pending.done.reason))
        return pending.request.number

    fast = MotionParameters(joint_jerk_percent=500, acceleration_override=20)
    one = ask(lambda number: StartMotion(number, MotionKind.SMART_SERVO, fast, None))
    record = session.motions[one]
    for step in range(1, 6):
        goal = offset(start, A1=0.02 * step)
        ask(partial(SetDestination, motion=one, position=goal))
    pair.run_until(lambda: pair.bench.commanded(0)[-1] == start[0] + 0.02 * 5)
    ask(lambda number: SetRuntimeParameters(number, one, minimum_execution_time_s=0.1))
    two = ask(lambda number: StartMotion(number, MotionKind.DIRECT_SERVO, fast, None))
    other = session.motions[two]
    three = ask(lambda number: StartMotion(number, MotionKind.PTP, fast, start))
    ask(lambda number: StopMotion(number, three))
    ask(lambda number: StopMotion(number, 999))
    ask(lambda number: StopMotion(number, one))
    pair.run_until(lambda: record.ended is not None)
    ask(lambda number: SetDestination(number, two, (0.0,) * 6))
    pair.run_until(lambda: other.ended is not None)
    for ended in (record.ended, other.ended):
        assert isinstance(ended, MotionEnded)
        outcomes.append((ended.end, ended.reason))
    outcomes.append(pair.bench.link.requests_taken)
    outcomes.append(pair.bench.link.requests_refused)
    outcomes.append(session.reports_lost)
    return outcomes


@pytest.mark.parametrize("seed", range(12))
def test_loss_repetition_and_overtaking_change_no_outcome(seed: int) -> None:
    clear, lossy = Pair(seed, loss=0.0, repeat=0.0, latest_ms=0.2), Pair(seed)
    assert play(lossy) == play(clear)
    assert lossy.there.lost + lossy.back.lost > 5
    assert lossy.there.repeated + lossy.back.repeated > 5
    assert sum(lossy.bench.link.counters.by_outcome.values()) > 0
    assert clear.bench.link.counters.by_outcome == dict.fromkeys(clear.bench.link.counters.by_outcome, 0)


def test_what_the_outcomes_are() -> None:
    outcomes = play(Pair(3))
    assert outcomes[-5:-3] == [
        (MotionEnd.STOPPED, "stopped by the application"),
        (MotionEnd.FAILED, "interpolation error: ERROR_NUMBER_OF_DOFS"),
    ]
    assert outcomes[-3:] == [11, 2, 0]
    assert (StopMotion.__name__, RequestError.ILLEGAL_STATE) in [outcome[:2] for outcome in outcomes[:-5]]  # type: ignore[index]


def test_a_thousand_destinations_a_second_lose_none_that_is_not_superseded() -> None:
    pair = Pair(1, loss=0.0, repeat=0.0, latest_ms=0.9)
    session = pair.session
    start = pair.bench.description.initial_position_rad
    pair.run_until(lambda: session.running)
    pending = session.ask(lambda number: StartMotion(number, MotionKind.SMART_SERVO, MotionParameters(), None))
    pair.run_until(lambda: pending.done is not None)
    motion = pending.request.number
    asked = 5000
    for index in range(asked):
        goal = offset(start, A1=1e-5 * index)
        session.ask(partial(SetDestination, motion=motion, position=goal))
        pair.cycle()
    pair.run_until(lambda: not session.requests)
    pair.run_until(lambda: pair.bench.commanded(0)[-1] == start[0] + 1e-5 * (asked - 1))
    accounting = pair.bench.controller.motion.applications.active
    assert accounting is not None
    counts = accounting.motion.accounting
    assert counts.received == counts.executed + counts.superseded
    assert counts.received <= asked <= counts.received + session.requests.superseded
