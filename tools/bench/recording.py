"""Recordings made in virtual time: as ``hil run --capture`` writes them, with a machine's jitter, from a seed."""

import random
from collections.abc import Callable
from pathlib import Path
from typing import Final

from hil.config.station import RobotConfig
from hil.core.controller import FRI_LINK, Controller
from hil.core.events import Event
from hil.core.servo.link import SERVO_LINK
from hil.runtime.assembly import make_controller, open_parts
from hil.runtime.file_recorder import record_one_robot
from hil.runtime.journal import RobotJournal
from hil.values.link import Address, Source
from hil.values.operator import OperatorAction
from tools.bench.clients import PEER, RecordedClient

UNIX_EPOCH_NS: Final = 1_795_322_390 * 10**9
BOUND: Final = {FRI_LINK: Address("127.0.0.1", 30210), SERVO_LINK: Address("127.0.0.1", 30300)}
_SECRET: Final = bytes(range(32))
_SHORTEST_ANSWER_NS: Final = 150_000
_LONGEST_ANSWER_NS: Final = 450_000
_MOST_CLOSING_CYCLES: Final = 3000


class VirtualRun:
    """One robot and its client in virtual time, recorded to ``file``; lateness and answers vary, by ``seed``."""

    def __init__(self, config: RobotConfig, client: RecordedClient, file: Path, *, seed: int = 1) -> None:
        self.config = config
        self._client = client
        self._random = random.Random(seed)  # noqa: S311  # the same run every time is the point
        self._parts = open_parts(config)
        self.controller: Controller = make_controller(
            config, self._parts, unix_epoch_ns=UNIX_EPOCH_NS, fri_peer=PEER, token_secret=_SECRET
        )
        self.journal = RobotJournal(0)
        self.recorder = record_one_robot(
            self.journal,
            file,
            config,
            unix_epoch_ns=UNIX_EPOCH_NS,
            fri_peer=None if config.fri is None else PEER,
            bound=BOUND,
            token_secret=_SECRET,
        )
        self._period_ns = config.cycle_ms * 1_000_000
        self.now_ns = -self._period_ns
        self._coming: list[tuple[int, Source, bytes]] = []

    def run(self, seconds: float, *, progress: Callable[[float], None] | None = None) -> None:
        """Let time pass."""
        cycles = round(seconds * 1e9) // self._period_ns
        for cycle in range(cycles):
            self.cycle()
            if progress is not None and cycle % 1000 == 0:
                progress(cycle * self._period_ns / 1e9)

    def check(self) -> None:
        """Raise :class:`ConfigurationError` unless the client moves the arm."""
        self._client.check(self.controller)

    def operate(self, action: OperatorAction) -> None:
        """Do what the operator does, now."""
        at_ns = max(self.now_ns, 0) + self._random.randrange(self._period_ns)
        self.journal.operated(action, at_ns=at_ns)
        self.controller.operate(action, now_ns=at_ns)

    def close(self) -> None:
        """End the run in order, and complete the file."""
        try:
            at_ns = self.now_ns + self._period_ns
            self.journal.closed(at_ns=at_ns)
            self.controller.close(now_ns=at_ns)
            for _ in range(_MOST_CLOSING_CYCLES):
                self.cycle()
                if self.controller.closed:
                    break
            self.recorder.close()
        finally:
            self._parts.backend.close()

    def cycle(self) -> None:
        """One control cycle, with what arrives before it."""
        self.now_ns += self._period_ns
        due, self._coming = self._coming, []
        for at_ns, source, datagram in sorted(due, key=lambda one: one[0]):
            if at_ns > self.read_until_ns():
                self._coming.append((at_ns, source, datagram))
                continue
            self.controller.receive(datagram, source, now_ns=at_ns)
            self.journal.received(datagram, source.address, BOUND[source.link], at_ns=at_ns)
        lateness_ns = self.lateness_ns()
        departed_ns = self.now_ns + lateness_ns + self._random.randrange(50_000, 90_000)
        self.controller.tick(now_ns=self.now_ns, lateness_ns=lateness_ns)
        self.journal.ticked(due_ns=self.now_ns, lateness_ns=lateness_ns, departed_ns=departed_ns)
        self._send(departed_ns)
        self.events(self.controller.events())

    def events(self, events: list[Event]) -> None:
        """Take what the controller tells of a cycle; here nobody listens."""

    def _send(self, departed_ns: int) -> None:
        said = self.controller.outgoing(now_ns=departed_ns)
        for one in said:
            self.journal.sent(one.payload, BOUND[one.link], one.destination or PEER, at_ns=departed_ns)
        for source, datagram in self._client.answer(said):
            answer_ns = self.answer_ns()
            if answer_ns is not None:
                self._coming.append((departed_ns + answer_ns, source, datagram))

    def read_until_ns(self) -> int:
        """Return until when datagrams came that the coming cycle finds read."""
        return self.now_ns

    def lateness_ns(self) -> int:
        """Return how late the cycle begins that is due at ``now_ns``."""
        return self._random.randrange(20_000, 120_000)

    def answer_ns(self) -> int | None:
        """Return how long the client takes for its answer to what was just sent; None: it never comes."""
        return self._random.randrange(_SHORTEST_ANSWER_NS, _LONGEST_ANSWER_NS)
