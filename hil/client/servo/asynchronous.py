"""The asyncio client: the same calls for a program that has an event loop."""

from collections.abc import AsyncIterator, Iterable
from types import TracebackType
from typing import Self, TypeVar

from hil.client.servo import _operations as operations
from hil.client.servo._link import ClientShell, address_of, not_open, open_socket
from hil.client.servo._operations import Operation
from hil.client.servo._reader import Reader
from hil.client.servo.errors import CALLED_PREMATURELY, IllegalStateException, wrong_client
from hil.client.servo.motions import DirectServoMotion, Motion, PtpMotion, SmartServoMotion
from hil.client.servo.runtime import ServoRuntime
from hil.client.servo.session import MotionRecord, Update
from hil.values.servo import Snapshot

_T = TypeVar("_T")


class AsyncServoClient(ClientShell):
    """:class:`hil.client.servo.ServoClient` with ``async with`` and ``await``; see there. For the tasks of one loop."""

    _reader: Reader | None = None

    async def __aenter__(self) -> Self:
        await self.connect()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self._close(error)

    async def connect(self) -> None:
        """Begin a session; what ``async with`` does."""
        await self.close()
        address = address_of(self._controller)
        link = self._new_link()
        reader = await Reader.open(link, open_socket(address))
        try:
            await reader.run(operations.connect(link.session, controller=address, timeout_s=self._connect_timeout_s))
        except BaseException:
            await reader.close()
            raise
        self._reader = reader

    async def close(self) -> None:
        """Say goodbye and close; does nothing when it is closed. What the session commanded brakes."""
        await self._close(None)

    async def move_async(self, motion: "AsyncMotion") -> None:
        """Start ``motion``, or queue it behind those that run or wait; return when the controller has taken it."""
        self._take(motion)
        await self._run(operations.start(self.session, motion))

    async def move(self, motion: "AsyncMotion") -> None:
        """Start ``motion`` and wait until it has ended; raise :class:`CommandInvalidException` if not by itself."""
        self._take(motion)
        await self._run(operations.move(self.session, motion))

    def read_state(self) -> Snapshot:
        """Return the latest state of controller, arm and motions; does not wait."""
        self._open().link.raise_kept()
        operations.check(self.session)
        return self._snapshot()

    async def wait_for_state(self, timeout_s: float | None = None) -> Snapshot | None:
        """Wait for the next state and return it; None if there is none within ``timeout_s`` seconds."""
        return await self._run(operations.next_state(self.session, after=self.session.states, timeout_s=timeout_s))

    async def states(self) -> AsyncIterator[Snapshot]:
        """Yield the newest state, again and again; who is slow misses some. It ends by ``break``, or by an error."""
        while True:
            snapshot = await self.wait_for_state()
            if snapshot is not None:
                yield snapshot

    async def _run(self, operation: Operation[_T]) -> _T:
        return await self._open().run(operation)

    def _open(self) -> Reader:
        if self._reader is None:
            raise not_open()
        return self._reader

    async def _close(self, on_its_way: BaseException | None) -> None:
        reader, self._reader = self._reader, None
        if reader is not None:
            await reader.close()
            reader.link.raise_kept(on_its_way)


class AsyncMotion(Motion):
    """A motion of an :class:`AsyncServoClient`."""

    _client: AsyncServoClient | None = None

    def bind(self, client: object) -> None:
        """Belong to ``client`` from now on; raise :class:`IllegalStateException` if it runs or waits."""
        if not isinstance(client, AsyncServoClient):
            raise wrong_client(self, client, needed=AsyncServoClient)
        self.must_not_run("it may be started again when it has ended")
        self._client = client

    async def stop_motion(self) -> bool:
        """Brake and end it; see :meth:`hil.client.servo.SmartServo.stop_motion`."""
        return await self._opened()._run(operations.stop(self.record))

    async def wait_until_ended(self, timeout_s: float | None = None) -> bool:
        """Wait until it has ended; see :meth:`hil.client.servo.SmartServo.wait_until_ended`."""
        return await self._opened()._run(operations.finished(self.record, timeout_s=timeout_s))

    async def _transferred(self, timeout_s: float) -> tuple[MotionRecord, Update]:
        return await self._opened()._run(operations.transferred(self.record, timeout_s=timeout_s))

    def _opened(self) -> AsyncServoClient:
        if self._client is None:
            raise IllegalStateException(CALLED_PREMATURELY)
        return self._client


class AsyncRuntime(ServoRuntime):
    """:class:`hil.client.servo.SmartServoRuntime` and its sibling with ``await``; the getters are the same."""

    def __init__(self, client: AsyncServoClient, record: MotionRecord, update: Update) -> None:
        super().__init__(record, update)
        self._client = client

    async def set_destination(self, position: Iterable[float], velocity: Iterable[float] | None = None) -> int:
        """Go to ``position`` (rad), to be passed with ``velocity`` (rad/s); return when it arrived, in ns."""
        return await self._client._run(self._setting_destination(position, velocity))

    async def update_with_realtime_system(self) -> None:
        """Fetch a fresh state: one that the controller sends after the call."""
        await self._client._run(self._updating())

    async def set_minimum_trajectory_execution_time(self, seconds: float) -> None:
        """Shortest time in s from a destination to reaching it: >= 0, default 0.01. Changes the path."""
        await self._client._run(self._setting_parameters(minimum_execution_time_s=seconds))

    async def activate_wait_for_pause_during_set_destination(self, active: bool = True) -> None:
        """Whether it pauses when enabling switch or start key are released, and destinations wait: default True."""
        await self._client._run(self._setting_parameters(wait_for_pause=active))

    async def stop_motion(self) -> bool:
        """Brake and end the motion; return whether this call did, False when it had ended."""
        return await self._client._run(operations.stop(self._record))


class AsyncSmartServoRuntime(AsyncRuntime):
    """A SmartServo that runs, or is the next one to run."""

    async def activate_velocity_planning(self, active: bool = True) -> None:
        """Whether destinations are passed with their target velocity, for the speed timeout: default False."""
        await self._client._run(self._setting_parameters(velocity_planning=active))


class AsyncDirectServoRuntime(AsyncRuntime):
    """A DirectServo that runs, or is the next one to run."""


class AsyncSmartServo(SmartServoMotion, AsyncMotion):
    """:class:`hil.client.servo.SmartServo` for an :class:`AsyncServoClient`."""

    async def get_runtime(self, timeout_s: float = 10.0) -> AsyncSmartServoRuntime:
        """Wait until the motion runs, or is the next one to run; raise :class:`IllegalStateException` (manual 10.2)."""
        return AsyncSmartServoRuntime(self._opened(), *await self._transferred(timeout_s))


class AsyncDirectServo(DirectServoMotion, AsyncMotion):
    """:class:`hil.client.servo.DirectServo` for an :class:`AsyncServoClient`."""

    async def get_runtime(self, timeout_s: float = 10.0) -> AsyncDirectServoRuntime:
        """Wait until the motion runs, or is the next one to run; raise :class:`IllegalStateException` (manual 10.2)."""
        return AsyncDirectServoRuntime(self._opened(), *await self._transferred(timeout_s))


class AsyncPTP(PtpMotion, AsyncMotion):
    """:class:`hil.client.servo.PTP` for an :class:`AsyncServoClient`."""
