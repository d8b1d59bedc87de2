"""The direct servo modes: loops that pass the newest set-point on, as the application on a Cabinet does.

Source: kst-wire 4.7 for the minimum trajectory time and how velocities are integrated.
"""

from typing import Final

from hil.client.servo import AsyncDirectServo, AsyncDirectServoRuntime
from hil.kst.context import NEVER_S, OPERATORS_PATIENCE_S, Context
from hil.kst.jobs import CartesianServo, Ended, JointServo, Outcome, VelocityServo
from hil.kst.registers import STILL, Registers, pose_of
from hil.kst.shaping import MINIMUM_TIME_S, Shaping
from hil.values.pose import Pose

PASSED_MOST_S: Final = 0.02
"""A set-point acts over no more than that: while the operator pauses a program a destination waits, and the arm must
not make up for the pause in a leap."""
_NS_PER_S: Final = 1e9


async def direct_servo(context: Context, job: JointServo | CartesianServo | VelocityServo) -> Ended:
    """Pass set-points on until the stop; raise :class:`hil.client.servo.HilError` where the controller ends it."""
    motion = AsyncDirectServo().set_timeout_after_goal_reach(NEVER_S)
    if not isinstance(job, VelocityServo):
        motion.set_minimum_trajectory_execution_time(MINIMUM_TIME_S)
    await context.client.move_async(motion)
    try:
        runtime = await motion.get_runtime(OPERATORS_PATIENCE_S)
        match job:
            case JointServo():
                await _joints(context, runtime)
            case CartesianServo():
                await _poses(context, runtime, job.tcp_in_flange.inverse())
            case VelocityServo():
                await _velocities(context, runtime)
    finally:
        if motion.started:
            await motion.stop_motion()
    return Ended(Outcome.DONE)


async def _joints(context: Context, runtime: AsyncDirectServoRuntime) -> None:
    shaping, before_ns = Shaping(), runtime.get_time_stamp_of_update()
    while not context.stop.is_set():
        target_rad, measured_rad = context.registers.joints_rad, runtime.get_axis_q_msr_on_controller()
        now_ns = runtime.get_time_stamp_of_update()
        passed_s, before_ns = _passed_s(before_ns, now_ns), now_ns
        await runtime.set_destination(shaping.destination(target_rad or measured_rad, measured_rad, passed_s=passed_s))


async def _poses(context: Context, runtime: AsyncDirectServoRuntime, flange_in_tcp: Pose) -> None:
    while not context.stop.is_set():
        set_point = context.registers.servo_pose
        if set_point is None:
            await runtime.update_with_realtime_system()
        else:
            await runtime.set_destination(pose_of(set_point) @ flange_in_tcp)


async def _velocities(context: Context, runtime: AsyncDirectServoRuntime) -> None:
    registers, before_rad_s = context.registers, STILL
    position_rad = runtime.get_axis_q_msr_on_controller()
    before_ns = runtime.get_time_stamp_of_update()
    while not context.stop.is_set():
        if _silent(registers, context):
            registers.velocity_rad_s = STILL
            silence_ms = context.settings.watchdog_ms
            context.tell(f"no velocity came for {silence_ms} ms: the arm stops, and moves again with the next one")
        now_ns, velocity_rad_s = runtime.get_time_stamp_of_update(), registers.velocity_rad_s
        passed_s = _passed_s(before_ns, now_ns)
        position_rad = tuple(
            position + 0.5 * (old + new) * passed_s
            for position, old, new in zip(position_rad, before_rad_s, velocity_rad_s, strict=True)
        )
        before_ns, before_rad_s = now_ns, velocity_rad_s
        await runtime.set_destination(position_rad)


def _passed_s(before_ns: int, now_ns: int) -> float:
    return min((now_ns - before_ns) / _NS_PER_S, PASSED_MOST_S)


def _silent(registers: Registers, context: Context) -> bool:
    settings = context.settings
    if settings.strict or not settings.watchdog_ms or registers.velocity_rad_s == STILL:
        return False
    return context.now_ns() - registers.velocity_at_ns > settings.watchdog_ms * 1_000_000
