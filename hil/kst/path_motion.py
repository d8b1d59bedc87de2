"""A path run as a stream of DirectServo destinations, one for each state of the controller."""

from collections.abc import Callable
from typing import Final

from hil.client.servo import AsyncDirectServo, AsyncDirectServoRuntime, OperationMode, Snapshot
from hil.kst.context import NEVER_S, OPERATORS_PATIENCE_S, Context
from hil.kst.paths import Path, Profile, limits_of
from hil.values.pose import Pose

STEP_MOST_S: Final = 0.005
"""A path goes on by no more than that from one destination to the next, however late that one is."""
LAG_MOST_RAD: Final = 0.035
"""An axis that is farther behind than two degrees (near a singularity) is waited for; five would end the motion."""
_NS_PER_S: Final = 1e9

Interrupts = Callable[[Snapshot], bool]


async def follow(
    context: Context, path: Path, *, speed_mm_s: float, tcp_in_flange: Pose, interrupts: Interrupts
) -> None:
    """Run a path from where the arm stands at its beginning, or until a state ``interrupts`` it.

    Raises :class:`hil.client.servo.HilError` where the controller ended the motion.
    """
    in_t1 = context.client.operator.mode is OperationMode.T1
    limits = limits_of(path, speed_mm_s=speed_mm_s, tcp_in_flange=tcp_in_flange, in_t1=in_t1)
    if limits is None:
        return
    motion = AsyncDirectServo().set_timeout_after_goal_reach(NEVER_S)
    await context.client.move_async(motion)
    try:
        runtime = await motion.get_runtime(OPERATORS_PATIENCE_S)
        flange_in_tcp, profile = tcp_in_flange.inverse(), Profile(limits)
        before_ns, time_s = runtime.get_time_stamp_of_update(), 0.0
        while time_s < profile.duration_s:
            now_ns = runtime.get_time_stamp_of_update()
            if _lag_rad(runtime) < LAG_MOST_RAD:
                time_s += min((now_ns - before_ns) / _NS_PER_S, STEP_MOST_S)
            before_ns = now_ns
            await runtime.set_destination(path.at(profile.at(time_s)) @ flange_in_tcp)
            if interrupts(context.client.read_state()):
                return
        while not runtime.is_destination_reached():
            await runtime.update_with_realtime_system()
            if interrupts(context.client.read_state()):
                return
    finally:
        if motion.started:
            await motion.stop_motion()


def _lag_rad(runtime: AsyncDirectServoRuntime) -> float:
    """Return how far the slowest axis is behind the last destination."""
    destination, reached = runtime.get_current_joint_destination(), runtime.get_command_result_of_interpolation()
    return max((abs(there - here) for there, here in zip(destination, reached, strict=False)), default=0.0)
