"""The impedance mode: SmartServo to the newest joint set-point, on Cartesian springs (kst-wire 4.6, 4.7)."""

from typing import Final

from hil.client.servo import (
    AsyncServoClient,
    AsyncSmartServo,
    AttachedTool,
    CartesianImpedanceControlMode,
    FrameKind,
    Load,
    by_translation,
)
from hil.kst.context import NEVER_S, OPERATORS_PATIENCE_S, Context
from hil.kst.jobs import Ended, ImpedanceServo, Outcome
from hil.values.kst import UnprovenLoad
from hil.values.pose import Pose

PERIOD_NS: Final = 30_000_000
VELOCITY_REL: Final = 0.1
ACCELERATION_REL: Final = 0.1
MINIMUM_TIME_S: Final = 0.02
PATH_DEVIATION: Final = 50.0
"""mm and rad."""
TCP_IN_FLANGE: Final = Pose(0.0, 0.0, 0.1)
_MM: Final = 1e-3


async def impedance_servo(context: Context, job: ImpedanceServo) -> Ended:
    """Pass joint set-points on until the stop; raise :class:`hil.client.servo.HilError` where that cannot be."""
    mode = CartesianImpedanceControlMode(
        stiffness=by_translation(job.translational_n_m, job.rotational_nm_rad),
        null_space_stiffness_nm_rad=job.null_space_nm_rad,
        max_path_deviation=(PATH_DEVIATION,) * 6,
    )
    tool = await _proven_tool(context, job)
    if isinstance(tool, str):
        return Ended(Outcome.FAILED, tool)
    motion = (
        AsyncSmartServo()
        .set_joint_velocity_rel(VELOCITY_REL)
        .set_joint_acceleration_rel(ACCELERATION_REL)
        .set_minimum_trajectory_execution_time(MINIMUM_TIME_S)
        .set_timeout_after_goal_reach(NEVER_S)
        .set_mode(mode)
    )
    await context.client.move_async(motion, tool)
    try:
        await _pass_on(context, motion)
    finally:
        if motion.started:
            await motion.stop_motion()
    return Ended(Outcome.DONE)


async def _pass_on(context: Context, motion: AsyncSmartServo) -> None:
    runtime = await motion.get_runtime(OPERATORS_PATIENCE_S)
    due_ns = 0
    while not context.stop.is_set():
        target_rad = context.registers.joints_rad
        if target_rad is None or runtime.get_time_stamp_of_update() < due_ns:
            await runtime.update_with_realtime_system()
        else:
            await runtime.set_destination(target_rad)
            due_ns = runtime.get_time_stamp_of_update() + PERIOD_NS


async def _proven_tool(context: Context, job: ImpedanceServo) -> AttachedTool | str:
    """Return the tool to reckon with: the one told, or one whose load explains the torques; or why there is none."""
    client, settings = context.client, context.settings
    x, y, z = (value * _MM for value in job.centre_mm)
    told = AttachedTool(Load(job.mass_kg, (x, y, z)), TCP_IN_FLANGE)
    if await client.validate_for_impedance_mode(told):
        return told
    failure = client.validation_failure
    if settings.strict or settings.unproven_load is UnprovenLoad.REFUSE:
        return failure
    for load in _loads_of_the_station(client):
        known = AttachedTool(load, TCP_IN_FLANGE)
        if await client.validate_for_impedance_mode(known):
            context.tell(
                f"a Cabinet may refuse this impedance mode: {failure}. Taken instead: {load.mass_kg:g} kg, which does "
                "explain them; [robot.load] of the station file says what truly hangs on the flange"
            )
            return known
    return failure


def _loads_of_the_station(client: AsyncServoClient) -> list[Load]:
    tree = client.frames
    return [Load(), *(tree.load_of(name) for name, frame in tree.items() if frame.kind is FrameKind.TOOL)]
