"""Jobs done with the motions of the servo link's client: one task at a time."""

import asyncio
import contextlib
from collections.abc import Callable
from typing import Final

from hil.client.servo import AsyncPTP, AsyncServoClient, HilError, Snapshot
from hil.kst.context import Context
from hil.kst.impedance import impedance_servo
from hil.kst.jobs import (
    CircleMotion,
    Ended,
    ImpedanceServo,
    Job,
    JointMotion,
    LineMotion,
    Outcome,
    RelativeLine,
    TorqueRange,
)
from hil.kst.path_motion import follow
from hil.kst.paths import Circle, Line, Path
from hil.kst.real_time import direct_servo
from hil.kst.registers import Registers
from hil.kst.robot import Robot
from hil.kst.session import Arm
from hil.values.kst import KstSettings
from hil.values.operator import ProgramState
from hil.values.pose import Pose

SETTLED_RAD: Final = 2e-4
SETTLING_STATES: Final = 100
"""States for which a motion that has ended waits until the arm has followed its set-point."""
REACHED_RAD: Final = 0.0017453
"""How near each axis of a conditional joint motion is to its target where that counts as reached: 0.1 degrees."""
REACHED_M: Final = 2e-4
"""The same of a line, on x, y and z."""
_ABORT_S: Final = 2.0


class ServoArm(Arm):
    """Does jobs with ``robot``, which is connected; ``ended`` hears how each of them ended, ``tell`` what happens."""

    def __init__(
        self,
        robot: Robot,
        settings: KstSettings,
        *,
        ended: Callable[[Ended], None],
        tell: Callable[[str], None],
        now_ns: Callable[[], int],
    ) -> None:
        self.registers = Registers()
        """The session's, from which real-time modes take their set-points."""
        self._robot = robot
        self._settings = settings
        self._ended = ended
        self._tell = tell
        self._now_ns = now_ns
        self._stop = asyncio.Event()
        self._task: asyncio.Task[None] | None = None

    def begin(self, job: Job) -> None:
        """Begin a job; the one before has ended."""
        self._stop = asyncio.Event()
        self._task = asyncio.get_running_loop().create_task(self._run(job, self._stop), name=type(job).__name__)

    def stop(self) -> None:
        """End the real-time mode that runs."""
        self._stop.set()

    async def finish(self) -> None:
        """Wait until the job that runs has ended."""
        if self._task is not None:
            await asyncio.gather(self._task, return_exceptions=True)

    async def abort(self) -> None:
        """Give up the job that runs; what it moves brakes."""
        if self._task is not None:
            self._task.cancel()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_ABORT_S):
                    await asyncio.gather(self._task, return_exceptions=True)

    async def _run(self, job: Job, stop: asyncio.Event) -> None:
        try:
            client = await self._robot.commander()
            if client.operator.program is ProgramState.PAUSED:
                self._tell(f"the motion waits for the operator: {client.operator.reason}")
            context = Context(client, self.registers, self._settings, self._tell, self._now_ns, stop)
            ended = await _do(job, context)
        except HilError as error:
            # What the manual has no text for, the figures, is in the notes.
            ended = Ended(Outcome.FAILED, "; ".join([str(error), *getattr(error, "__notes__", ())]))
        except Exception as error:  # noqa: BLE001  # a bug of ours must not leave a client waiting for ever
            ended = Ended(Outcome.FAILED, f"the server failed: {error!r}")
        self._ended(ended)


async def _do(job: Job, context: Context) -> Ended:
    match job:
        case JointMotion():
            return await _move_joints(context, job)
        case LineMotion():
            path: Path = Line(_tcp(context, job.tcp_in_flange), job.target)
            await follow(
                context,
                path,
                speed_mm_s=job.speed_mm_s,
                tcp_in_flange=job.tcp_in_flange,
                interrupts=lambda state: _met(context, job.conditions, state),
            )
            return _line_ended(job, await _settled(context.client))
        case RelativeLine() | CircleMotion():
            path = _relative(context, job) if isinstance(job, RelativeLine) else _circle(context, job)
            await follow(
                context,
                path,
                speed_mm_s=job.speed_mm_s,
                tcp_in_flange=job.tcp_in_flange,
                interrupts=lambda _state: False,
            )
            await _settled(context.client)
            return Ended(Outcome.DONE)
        case ImpedanceServo():
            return await impedance_servo(context, job)
        case _:
            return await direct_servo(context, job)


async def _move_joints(context: Context, job: JointMotion) -> Ended:
    motion = AsyncPTP(job.target_rad).set_joint_velocity_rel(job.velocity_rel)
    await context.client.move_async(motion)
    while not await motion.wait_until_ended(timeout_s=0.0 if job.conditions else None):
        if _met(context, job.conditions, await _next_state(context.client)):
            await motion.stop_motion()
            break
    state = await _settled(context.client)
    pairs = zip(job.target_rad, state.measured_position, strict=True)
    if job.conditional and any(abs(there - here) > REACHED_RAD for there, here in pairs):
        return Ended(Outcome.INTERRUPTED)
    return Ended(Outcome.DONE)


def _relative(context: Context, job: RelativeLine) -> Line:
    start = _tcp(context, job.tcp_in_flange)
    way = Pose(*job.way_m)  # type: ignore[arg-type]  # three numbers
    if job.in_tool:
        way = Pose(0.0, 0.0, 0.0, start.rotation) @ way
    x, y, z = (here + there for here, there in zip(start.position_m, way.position_m, strict=True))
    return Line(start, Pose(x, y, z, start.rotation))


def _circle(context: Context, job: CircleMotion) -> Circle:
    return Circle(_tcp(context, job.tcp_in_flange), job.auxiliary, job.end)


def _line_ended(job: LineMotion, state: Snapshot) -> Ended:
    here, there = (state.flange_in_base @ job.tcp_in_flange).position_m, job.target.position_m
    if job.conditional and any(abs(a - b) > REACHED_M for a, b in zip(here, there, strict=True)):
        return Ended(Outcome.INTERRUPTED)
    return Ended(Outcome.DONE)


def _tcp(context: Context, tcp_in_flange: Pose) -> Pose:
    return context.client.read_state().flange_in_base @ tcp_in_flange


async def _next_state(client: AsyncServoClient) -> Snapshot:
    return await client.wait_for_state() or client.read_state()


async def _settled(client: AsyncServoClient) -> Snapshot:
    """Return the state in which the arm has followed its set-point, or the last one waited for."""
    state = client.read_state()
    for _ in range(SETTLING_STATES):
        state = await _next_state(client)
        pairs = zip(state.measured_position, state.commanded_position, strict=True)
        if all(abs(measured - commanded) <= SETTLED_RAD for measured, commanded in pairs):
            break
    return state


def _met(context: Context, conditions: tuple[TorqueRange, ...], state: Snapshot) -> bool:
    """Return whether a condition interrupts a motion now, and say which."""
    for axis, least_nm, most_nm in conditions:
        torque_nm = state.measured_torque[axis]
        if not least_nm <= torque_nm <= most_nm:
            context.tell(f"interrupted: A{axis + 1} shows {torque_nm:.2f} Nm, outside {least_nm:g}..{most_nm:g} Nm")
            return True
    return False
