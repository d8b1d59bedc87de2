"""The blocking client: for programs that wait for each call."""

from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import Self, TypeVar, overload

from hil.client.servo import _frames as frames
from hil.client.servo import _operations as operations
from hil.client.servo._frames import FrameName, Moved
from hil.client.servo._link import ClientShell, address_of, not_open
from hil.client.servo._operations import Operation
from hil.client.servo._pump import ServoPump, open_pump
from hil.client.servo._pushes import checked_push
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


class ServoClient(ClientShell):
    """A session with a controller, open inside its ``with`` block; any thread may call it.

    Between calls a thread of its own keeps the session alive. A session that is over (the controller ended it, or was
    silent for the longer of 1 s and three watchdogs) raises :class:`SessionEnded` from every call that waits.
    """

    _pump: ServoPump | None = None

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._close(error)

    def connect(self) -> None:
        """Begin a session; what ``with`` does. Says hello every 50 ms, for the connect timeout.

        Raises :class:`ControllerSilent` or :class:`SessionRefused` (both :class:`EndpointError`).
        """
        self.close()
        address = address_of(self._controller)
        link = self._new_link()
        pump = open_pump(link, address)
        try:
            pump.run(operations.connect(link.session, controller=address, timeout_s=self._connect_timeout_s))
            pump.run(operations.fetch_frames(link.session))
            pump.start()
        except BaseException:
            pump.close()
            raise
        self._pump = pump

    def close(self) -> None:
        """Say goodbye and close; does nothing when it is closed. What the session commanded brakes."""
        self._close(None)

    def move_async(self, motion: "BlockingMotion", frame: Moved = FLANGE) -> None:
        """Start ``motion``, or queue it behind those that run or wait; return when the controller has taken it.

        ``frame`` is what its Cartesian destinations are for: the flange, or a frame that moves with it (manual 8.1.2),
        or the TCP of an :class:`AttachedTool` of the program's own, whose load is reckoned with.
        """
        self._run(operations.start(self.session, motion, self._take(motion, frame)))

    def move(self, motion: "BlockingMotion", frame: Moved = FLANGE) -> None:
        """Start ``motion`` and wait until it has ended; raise :class:`CommandInvalidException` if not by itself."""
        self._run(operations.move(self.session, motion, self._take(motion, frame)))

    def validate_for_impedance_mode(self, frame: Moved = FLANGE) -> bool:
        """Return whether the load of ``frame``'s tool explains what the torque sensors show at rest (manual 7.10.1).

        Impedance control needs it once in a session. Where it fails, :attr:`validation_failure` says why.
        """
        moved = frames.moved_frame(self.frames, frame)
        self.validation_failure = self._run(operations.validate_load(self.session, moved))
        return not self.validation_failure

    def push(
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
        self._run(operations.push(self.session, checked_push(link, force_n, moment_nm, duration_s)))

    def read_state(self) -> Snapshot:
        """Return the latest state of controller, arm and motions; does not wait."""
        self._open().look()
        operations.check(self.session)
        return self._snapshot()

    def wait_for_state(self, timeout_s: float | None = None) -> Snapshot | None:
        """Wait for the next state and return it; None if there is none within ``timeout_s`` seconds."""
        return self._run(operations.next_state(self.session, after=self.session.states, timeout_s=timeout_s))

    def states(self) -> Iterator[Snapshot]:
        """Yield the newest state, again and again; who is slow misses some. It ends by ``break``, or by an error."""
        while True:
            snapshot = self.wait_for_state()
            if snapshot is not None:
                yield snapshot

    def _run(self, operation: Operation[_T]) -> _T:
        return self._open().run(operation)

    def _open(self) -> ServoPump:
        if self._pump is None:
            raise not_open()
        return self._pump

    def _close(self, on_its_way: BaseException | None) -> None:
        pump, self._pump = self._pump, None
        if pump is not None:
            pump.close()
            pump.link.raise_kept(on_its_way)


class BlockingMotion(Motion):
    """A motion of a :class:`ServoClient`."""

    _client: ServoClient | None = None

    def bind(self, client: object) -> None:
        """Belong to ``client`` from now on; raise :class:`IllegalStateException` if it runs or waits."""
        if not isinstance(client, ServoClient):
            raise wrong_client(self, client, needed=ServoClient)
        self.must_not_run("it may be started again when it has ended")
        self._client = client

    def stop_motion(self) -> bool:
        """Brake and end it; return whether this call did, False when it had ended.

        Raises :class:`IllegalStateException` for a motion that was not started (manual 10.2). One that still waits is
        withdrawn.
        """
        return self._opened()._run(operations.stop(self.record))

    def wait_until_ended(self, timeout_s: float | None = None) -> bool:
        """Wait until it has ended; False if it has not within ``timeout_s`` seconds.

        Raises :class:`CommandInvalidException` if it did not end by itself.
        """
        return self._opened()._run(operations.finished(self.record, timeout_s=timeout_s))

    def _transferred(self, timeout_s: float) -> tuple[MotionRecord, Update]:
        return self._opened()._run(operations.transferred(self.record, timeout_s=timeout_s))

    def _opened(self) -> ServoClient:
        if self._client is None:
            raise IllegalStateException(CALLED_PREMATURELY)
        return self._client


class BlockingRuntime(ServoRuntime):
    """The calls both servo runtimes share. Each one raises :class:`CommandInvalidException` when the motion is over."""

    def __init__(self, client: ServoClient, record: MotionRecord, update: Update) -> None:
        super().__init__(record, update)
        self._client = client

    @overload
    def set_destination(self, destination: Pose, reference: FrameName = ..., /) -> int: ...
    @overload
    def set_destination(self, destination: Iterable[float], velocity: Iterable[float] | None = ..., /) -> int: ...
    def set_destination(
        self, destination: Iterable[float] | Pose, velocity_or_reference: VelocityOrReference = UNSAID, /
    ) -> int:
        """Go to a destination: seven axis positions in rad, to be passed with ``velocity`` (rad/s; SmartServo only).

        Or a :class:`Pose` of the frame that the motion moves, in ``reference``, which stands still: by default the
        robot base. The controller chooses the axis positions nearest to where the arm is to be then.

        Returns when the destination arrived at the controller, in ns of its time; updates the data. One that is
        replaced by a newer one, from another thread, before it was sent is answered with the newer one's time. While
        the operator has paused the program it waits until he starts it again, or the motion ends (manual 9.1.2).
        """
        return self._client._run(self._setting_destination(destination, velocity_or_reference))

    def get_current_cartesian_destination(self, frame_on_flange: Moved, reference: FrameName = BASE) -> Pose | None:
        """Pose of ``frame_on_flange`` in ``reference`` at the last destination; None before there is one.

        Of the last update; the controller is asked, once, where the flange is at a destination in axis positions.
        Raises :class:`IllegalArgumentException` (manual 10.2).
        """
        return self._client._run(self._reading_cartesian_destination(frame_on_flange, reference))

    def update_with_realtime_system(self) -> None:
        """Fetch a fresh state: one that the controller sends after the call."""
        self._client._run(self._updating())

    def change_control_mode_settings(self, mode: ControlModeSettings) -> None:
        """Change the parameters the arm is controlled with, while it moves (manual 7.10.3); the kind stays.

        Raises :class:`IllegalArgumentException` for another kind of control.
        """
        self._client._run(self._changing_control_mode(mode))

    def set_minimum_trajectory_execution_time(self, seconds: float) -> None:
        """Shortest time in s from a destination to reaching it: >= 0, default 0.01. Changes the path."""
        self._client._run(self._setting_parameters(minimum_execution_time_s=seconds))

    def activate_wait_for_pause_during_set_destination(self, active: bool = True) -> None:
        """Whether it pauses when enabling switch or start key are released, and destinations wait: default True."""
        self._client._run(self._setting_parameters(wait_for_pause=active))

    def stop_motion(self) -> bool:
        """Brake and end the motion, or withdraw it while it waits; return whether this call did, False at its end."""
        return self._client._run(operations.stop(self._record))


class SmartServoRuntime(BlockingRuntime):
    """A SmartServo that runs, or is the next one to run."""

    def activate_velocity_planning(self, active: bool = True) -> None:
        """Whether destinations are passed with their target velocity, for the speed timeout: default False."""
        self._client._run(self._setting_parameters(velocity_planning=active))


class DirectServoRuntime(BlockingRuntime):
    """A DirectServo that runs, or is the next one to run."""


class SmartServo(SmartServoMotion, BlockingMotion):
    """A SmartServo: jerk-limited, to ``initial_position`` first (None: stay), then to each new destination.

    That is axis positions in rad, or a :class:`Pose` of the moved frame in the robot base.
    """

    def get_runtime(self, timeout_s: float = 10.0) -> SmartServoRuntime:
        """Wait until the motion runs, or is the next one to run; raise :class:`IllegalStateException` (manual 10.2)."""
        return SmartServoRuntime(self._opened(), *self._transferred(timeout_s))


class DirectServo(DirectServoMotion, BlockingMotion):
    """A DirectServo: a velocity-limited filter, for destinations within 5 degrees of the measured axis position."""

    def get_runtime(self, timeout_s: float = 10.0) -> DirectServoRuntime:
        """Wait until the motion runs, or is the next one to run; raise :class:`IllegalStateException` (manual 10.2)."""
        return DirectServoRuntime(self._opened(), *self._transferred(timeout_s))


class PTP(PtpMotion, BlockingMotion):
    """A jerk-limited motion to ``destination``: axis positions in rad, or a Pose of the moved frame in the robot base.

    In axis space, so always on the same path.
    """
