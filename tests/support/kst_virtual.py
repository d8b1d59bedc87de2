"""A KST session at a controller in virtual time: its bytes, without a socket."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from hil.client.servo import SessionEnded
from hil.clock import stopwatch_ns
from hil.kst.arm import ServoArm
from hil.kst.jobs import Ended
from hil.kst.robot import Robot, client_factory
from hil.kst.session import KstSession
from hil.values.kst import KstSettings
from hil.values.servo import Snapshot

CONTROLLER = "127.0.0.1:30300"
SETTINGS = KstSettings((-2.9, -2.0, -2.9, -2.0, -2.9, -2.0, -3.0), (2.9, 2.0, 2.9, 2.0, 2.9, 2.0, 3.0))


class Visit:
    """One client's session; ``told`` is the log."""

    def __init__(self, settings: KstSettings, told: list[str]) -> None:
        self.told = told
        self.robot = Robot(client_factory(CONTROLLER, state_period_ms=1, key=None), tell=told.append)
        self.arm = ServoArm(self.robot, settings, ended=self._ended, tell=told.append, now_ns=stopwatch_ns)
        self.session = KstSession(settings, self.arm, self.robot.state)
        self.arm.registers = self.session.registers
        self._written: list[bytes] = []

    async def ask(self, line: str, replies: int = 1, at_most_s: float = 60.0) -> list[str]:
        """Send a line; return so many replies, without their ends."""
        self.session.receive(line.encode() + b"\n", now_ns=stopwatch_ns())
        until_ns = stopwatch_ns() + int(at_most_s * 1e9)
        self._take()
        while len(self._written) < replies:
            assert stopwatch_ns() < until_ns, f"{line!r}: only {self._written} in {at_most_s} s"
            await self.next_state()
        got, self._written = self._written, []
        return [reply.decode().strip() for reply in got]

    async def numbers(self, line: str) -> list[float]:
        """Send a line; return the numbers of its reply."""
        (reply,) = await self.ask(line)
        return [float(text) for text in reply.split("_")[:-1]]

    async def move(self, *lines: str, at_most_s: float = 60.0) -> str:
        """Send lines, of which the last one starts a motion; return its second reply."""
        for line in lines[:-1]:
            assert await self.ask(line) == ["done"]
        first, second = await self.ask(lines[-1], replies=2, at_most_s=at_most_s)
        assert first == "done"
        return second

    async def pass_s(self, seconds: float) -> None:
        """Let time pass."""
        until_ns = stopwatch_ns() + int(seconds * 1e9)
        while stopwatch_ns() < until_ns:
            await self.next_state()

    async def next_state(self) -> Snapshot:
        """Return the controller's next state."""
        client = self.robot.client
        try:
            state = await client.wait_for_state()
        except SessionEnded:
            # The server has got itself the commander's session meanwhile.
            assert client is not self.robot.client
            state = None
        self._take()
        return state or self.robot.state()

    async def watch(self, line: str) -> AsyncIterator[Snapshot]:
        """Send a line that starts a motion; yield the states until it has ended, well."""
        assert await self.ask(line) == ["done"]
        while not self._written:
            yield await self.next_state()
        assert await self.ask("", replies=1) == ["done"]

    def _ended(self, ended: Ended) -> None:
        self.session.ended(ended, now_ns=stopwatch_ns())
        self._take()

    def _take(self) -> None:
        self._written += self.session.replies(now_ns=stopwatch_ns())
        while self.session.told:
            self.told.append(self.session.told.popleft())


@asynccontextmanager
async def visit(settings: KstSettings = SETTINGS, told: list[str] | None = None) -> AsyncIterator[Visit]:
    """A session that is connected, and ends as one whose client has left."""
    visitor = Visit(settings, [] if told is None else told)
    await visitor.robot.connect()
    try:
        yield visitor
    finally:
        await visitor.arm.abort()
        await visitor.robot.close()
