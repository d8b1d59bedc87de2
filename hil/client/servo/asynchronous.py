"""The asyncio client: the same calls for a program that has an event loop."""

from collections.abc import AsyncIterator, Iterable
from types import TracebackType
from typing import Self, TypeVar, overload

from hil.client.servo import _frames as frames
from hil.client.servo import _operations as operations
from hil.client.servo._frames import FrameName, Moved
from hil.client.servo._link import ClientShell, address_of, not_open, open_loop_socket
from hil.client.servo._operations import Operation
from hil.client.servo._pushes import checked_push
from hil.client.servo._reader import Reader
from hil.client.servo.errors import CALLED_PREMATURELY, IllegalStateException, wrong_client
from hil.client.servo.motions import DirectServoMotion, Motion, PtpMotion, SmartServoMotion
from hil.client.servo.runtime import UNSAID, ServoRuntime, VelocityOrReference
from hil.client.servo.session import MotionRecord, Update
from hil.values.arm import DEFAULT_PUSH_S
from hil.values.control import ControlModeSettings
from hil.values.frames import BASE, FLANGE
from hil.values.pose import Pose
from hil.values.robot import JOINT_COUNT
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
        reader = await Reader.open(link, open_loop_socket(address))
        try:
            await reader.run(operations.connect(link.session, controller=address, timeout_s=self._connect_timeout_s))
            await reader.run(operations.fetch_frames(link.session))
        except BaseException:
            await reader.close()
            raise
        self._reader = reader

    async def close(self) -> None:
        """Say goodbye and close; does nothing when it is closed. What the session commanded brakes."""
        await self._close(None)

    async def move_async(self, motion: "AsyncMotion", frame: Moved = FLANGE) -> None:
        """Start ``motion``, or queue it behind those that run or wait; return when the controller has taken it.

        ``frame`` is what its Cartesian destinations are for: the flange, or a frame that moves with it (manual 8.1.2),
        or the TCP of an :class:`AttachedTool` of the program's own, whose load is reckoned with.
        """
        await self._run(operations.start(self.session, motion, self._take(motion, frame)))

    async def move(self, motion: "AsyncMotion", frame: Moved = FLANGE) -> None:
        """Start ``motion`` and wait until it has ended; raise :class:`CommandInvalidException` if not by itself."""
        await self._run(operations.move(self.session, motion, self._take(motion, frame)))

    async def validate_for_impedance_mode(self, frame: Moved = FLANGE) -> bool:
        """Return whether the load of ``frame``'s tool explains what the torque sensors show at rest (manual 7.10.1).

        Impedance control needs it once in a session. Where it fails, :attr:`validation_failure` says why.
        """
        moved = frames.moved_frame(self.frames, frame)
        self.validation_failure = await self._run(operations.validate_load(self.session, moved))
        return not self.validation_failure

    async def push(
        self,
        force_n: Iterable[float],
        *,
        link: int = JOINT_COUNT,
        moment_nm: Iterable[float] = (0.0, 0.0, 0.0),
        duration_s: float = DEFAULT_PUSH_S,
    ) -> None:
        """Push a simulated arm at the outer end of a link (7: the flange), N and Nm in axes of the robot base.

        Only with ``role=Role.OPERATOR``; a new push replaces the one before. At most 500 N, 100 Nm, 60 s: raises
        :class:`OutOfRange` at the call.
        """
        await self._run(operations.push(self.session, checked_push(link, force_n, moment_nm, duration_s)))

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

    @overload
    async def set_destination(self, destination: Pose, reference: FrameName = ..., /) -> int: ...
    @overload
    async def set_destination(self, destination: Iterable[float], velocity: Iterable[float] | None = ..., /) -> int: ...
    async def set_destination(
        self, destination: Iterable[float] | Pose, velocity_or_reference: VelocityOrReference = UNSAID, /
    ) -> int:
        """Go to axis positions (rad), passed with ``velocity`` (rad/s), or a Pose; return when it arrived, in ns."""
        return await self._client._run(self._setting_destination(destination, velocity_or_reference))

    async def get_current_cartesian_destination(
        self, frame_on_flange: Moved, reference: FrameName = BASE
    ) -> Pose | None:
        """Pose of ``frame_on_flange`` in ``reference`` at the last destination; None before there is one.

        Of the last update; the controller is asked, once, where the flange is at a destination in axis positions.
        Raises :class:`IllegalArgumentException` (manual 10.2).
        """
        return await self._client._run(self._reading_cartesian_destination(frame_on_flange, reference))

    async def update_with_realtime_system(self) -> None:
        """Fetch a fresh state: one that the controller sends after the call."""
        await self._client._run(self._updating())

    async def change_control_mode_settings(self, mode: ControlModeSettings) -> None:
        """Change the parameters the arm is controlled with, while it moves (manual 7.10.3); the kind stays.

        Raises :class:`IllegalArgumentException` for another kind of control.
        """
        await self._client._run(self._changing_control_mode(mode))

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
