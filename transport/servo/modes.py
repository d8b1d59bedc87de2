"""Control modes on the wire."""

from collections.abc import Sequence

from hil.values.arm import seven
from hil.values.control import (
    POSITION_CONTROL,
    CartesianImpedanceControlMode,
    CartesianSineImpedanceControlMode,
    ControlModeSettings,
    ForceOscillation,
    JointImpedanceControlMode,
    PositionControlMode,
)
from hil.values.errors import ConfigurationError
from hil.values.robot import JOINT_COUNT, Seven, Six
from transport.servo import servo_pb2
from transport.servo.fields import read_counted, undecodable


def read_mode(wire: servo_pb2.StartMotion | servo_pb2.ChangeControlMode) -> ControlModeSettings:
    """Return the mode in a request; raise :class:`MalformedDatagram` where a number is none it may have."""
    if not wire.HasField("mode"):
        return POSITION_CONTROL
    mode = wire.mode
    kind = mode.WhichOneof("kind")
    try:
        if kind == "joint":
            return JointImpedanceControlMode(_seven(mode.joint.stiffness), _seven(mode.joint.damping))
        if kind == "cartesian":
            return _cartesian(mode.cartesian)
    except ConfigurationError as error:
        raise undecodable(f"a control mode nobody can have: {error}") from None
    # Not position control: an arm that is to give way must not be stiff because its mode is not known here.
    raise undecodable("a control mode of no kind that is known here")


def wire_mode(mode: ControlModeSettings) -> servo_pb2.ControlMode | None:
    """Return a mode; None for position control, which goes without saying."""
    if isinstance(mode, PositionControlMode):
        return None
    if isinstance(mode, JointImpedanceControlMode):
        joint = servo_pb2.JointImpedance(stiffness=mode.stiffness_nm_rad, damping=mode.damping)
        return servo_pb2.ControlMode(joint=joint)
    oscillation = None
    if isinstance(mode, CartesianSineImpedanceControlMode):
        oscillation, mode = _wire_oscillation(mode.oscillation), mode.impedance
    return servo_pb2.ControlMode(
        cartesian=servo_pb2.CartesianImpedance(
            stiffness=mode.stiffness,
            damping=mode.damping,
            null_space_stiffness_nm_rad=mode.null_space_stiffness_nm_rad,
            null_space_damping=mode.null_space_damping,
            additional_control_force=mode.additional_control_force,
            max_control_force=mode.max_control_force,
            stop_on_max_control_force=mode.stop_on_max_control_force,
            max_cartesian_velocity=mode.max_cartesian_velocity,
            max_path_deviation=mode.max_path_deviation,
            oscillation=oscillation,
        )
    )


def _cartesian(
    wire: servo_pb2.CartesianImpedance,
) -> CartesianImpedanceControlMode | CartesianSineImpedanceControlMode:
    mode = CartesianImpedanceControlMode(
        stiffness=_six(wire.stiffness),
        damping=_six(wire.damping),
        null_space_stiffness_nm_rad=wire.null_space_stiffness_nm_rad,
        null_space_damping=wire.null_space_damping,
        additional_control_force=_six(wire.additional_control_force),
        max_control_force=_six(wire.max_control_force),
        stop_on_max_control_force=wire.stop_on_max_control_force,
        max_cartesian_velocity=_six(wire.max_cartesian_velocity),
        max_path_deviation=_six(wire.max_path_deviation),
    )
    if not wire.HasField("oscillation"):
        return mode
    swing = wire.oscillation
    return CartesianSineImpedanceControlMode(
        mode,
        ForceOscillation(
            amplitude=_six(swing.amplitude),
            frequency_hz=_six(swing.frequency_hz),
            phase_deg=_six(swing.phase_deg),
            bias=_six(swing.bias),
            force_limit=_six(swing.force_limit),
            position_limit=_six(swing.position_limit),
            rise_time_s=swing.rise_time_s,
            hold_time_s=swing.hold_time_s,
            fall_time_s=swing.fall_time_s,
        ),
    )


def _wire_oscillation(swing: ForceOscillation) -> servo_pb2.ForceOscillation:
    return servo_pb2.ForceOscillation(
        amplitude=swing.amplitude,
        frequency_hz=swing.frequency_hz,
        phase_deg=swing.phase_deg,
        bias=swing.bias,
        force_limit=swing.force_limit,
        position_limit=swing.position_limit,
        rise_time_s=swing.rise_time_s,
        hold_time_s=swing.hold_time_s,
        fall_time_s=swing.fall_time_s,
    )


def _six(values: Sequence[float]) -> Six:
    x, y, z, a, b, c = read_counted(values, 6, "a control mode")
    return (x, y, z, a, b, c)


def _seven(values: Sequence[float]) -> Seven:
    return seven(read_counted(values, JOINT_COUNT, "a control mode"))
