"""Servo motions in Python: SmartServo, DirectServo and PTP, programmed as the vendor's manual does it, over UDP.

Methods have the manual's names in snake_case; ``docs/servo-api.md`` lists all of them. A client that raises axis 4 by
a tenth of a radian, as a PTP, and then lets it follow a sine::

    import math

    from hil.client.servo import PTP, ServoClient, SmartServo

    with ServoClient("127.0.0.1:30300") as robot:
        start = list(robot.read_state().measured_position)
        start[3] += 0.1
        robot.move(PTP(start).set_joint_velocity_rel(0.2))
        motion = SmartServo().set_joint_jerk(500).set_minimum_trajectory_execution_time(0.02)
        robot.move_async(motion)
        runtime = motion.get_runtime()
        began_ns = at_ns = runtime.get_time_stamp_of_update()
        while at_ns < began_ns + 5_000_000_000:
            swing = 0.1 * math.sin(2.0 * (at_ns - began_ns) * 1e-9)
            runtime.set_destination([*start[:3], start[3] + swing, *start[4:]])
            at_ns = runtime.get_time_stamp_of_update()
        print(runtime)
        runtime.stop_motion()

The client is an observer with ``role=Role.OBSERVER``. :class:`AsyncServoClient` with :class:`AsyncSmartServo`,
:class:`AsyncDirectServo` and :class:`AsyncPTP` is the same with ``async with`` and ``await``. :class:`ServoSession` is
what both are around: datagrams in, datagrams out, no socket and no clock.
"""

from hil.client.servo._set_point_accounting import SetPointAccounting
from hil.client.servo.asynchronous import (
    AsyncDirectServo,
    AsyncDirectServoRuntime,
    AsyncPTP,
    AsyncServoClient,
    AsyncSmartServo,
    AsyncSmartServoRuntime,
)
from hil.client.servo.blocking import (
    PTP,
    DirectServo,
    DirectServoRuntime,
    ServoClient,
    SmartServo,
    SmartServoRuntime,
)
from hil.client.servo.errors import (
    CommandInvalidException,
    ControllerSilent,
    IllegalArgumentException,
    IllegalStateException,
    SessionEnded,
    SessionRefused,
)
from hil.client.servo.runtime import IServoOnGoalReachedEvent
from hil.client.servo.session import ServoSession
from hil.client.servo.statistic_timer import OneTimeStep, StatisticTimer
from hil.values.control import (
    CartesianDof,
    CartesianImpedanceControlMode,
    CartesianPlane,
    CartesianSineImpedanceControlMode,
    ControlModeSettings,
    ForceOscillation,
    JointImpedanceControlMode,
    PositionControlMode,
    by_translation,
    create_desired_force,
    create_lissajous_pattern,
    create_sine_pattern,
    create_spiral_pattern,
)
from hil.values.errors import ConfigurationError, EndpointError, HilError, OutOfRange, UsageError
from hil.values.frames import Frame, FrameKind, FrameTree
from hil.values.fri import ControlMode, OperationMode, SafetyState
from hil.values.load import AttachedTool, Load
from hil.values.motion import (
    DIRECT_SERVO_DELTA_RAD,
    ErrorReason,
    FineInterpolatorState,
    MotionKind,
    MotionParameters,
    MotionPhase,
)
from hil.values.operator import OperatorView, ProgramState
from hil.values.outcomes import Outcome
from hil.values.pose import Pose
from hil.values.servo import SERVO_PORT, MotionState, Role, Snapshot, Vector, Welcome
from transport.servo import load_key

__all__ = [
    "DIRECT_SERVO_DELTA_RAD",
    "PTP",
    "SERVO_PORT",
    "AsyncDirectServo",
    "AsyncDirectServoRuntime",
    "AsyncPTP",
    "AsyncServoClient",
    "AsyncSmartServo",
    "AsyncSmartServoRuntime",
    "AttachedTool",
    "CartesianDof",
    "CartesianImpedanceControlMode",
    "CartesianPlane",
    "CartesianSineImpedanceControlMode",
    "CommandInvalidException",
    "ConfigurationError",
    "ControlMode",
    "ControlModeSettings",
    "ControllerSilent",
    "DirectServo",
    "DirectServoRuntime",
    "EndpointError",
    "ErrorReason",
    "FineInterpolatorState",
    "ForceOscillation",
    "Frame",
    "FrameKind",
    "FrameTree",
    "HilError",
    "IServoOnGoalReachedEvent",
    "IllegalArgumentException",
    "IllegalStateException",
    "JointImpedanceControlMode",
    "Load",
    "MotionKind",
    "MotionParameters",
    "MotionPhase",
    "MotionState",
    "OneTimeStep",
    "OperationMode",
    "OperatorView",
    "OutOfRange",
    "Outcome",
    "Pose",
    "PositionControlMode",
    "ProgramState",
    "Role",
    "SafetyState",
    "ServoClient",
    "ServoSession",
    "SessionEnded",
    "SessionRefused",
    "SetPointAccounting",
    "SmartServo",
    "SmartServoRuntime",
    "Snapshot",
    "StatisticTimer",
    "UsageError",
    "Vector",
    "Welcome",
    "by_translation",
    "create_desired_force",
    "create_lissajous_pattern",
    "create_sine_pattern",
    "create_spiral_pattern",
    "load_key",
]
