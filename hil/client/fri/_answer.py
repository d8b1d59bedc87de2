"""What a monitoring message must hold to be answered, and what is in the answer."""

import contextlib
import operator
from collections.abc import Mapping
from typing import Final

from hil.client.fri.command import Command
from hil.client.fri.errors import CommandShape, NotAvailable, WrongSignal
from hil.client.fri.state import FriState, io_type_name
from hil.values.errors import MalformedDatagram, UnknownName
from hil.values.fri import (
    TRAITS,
    ClientCommandMode,
    IODirection,
    IOType,
    Quality,
    RedundancyStrategy,
    Release,
    SessionState,
)
from hil.values.fri_messages import CommandData, IOValue, MonitoringMessage, Redundancy, Transformation, Vector
from hil.values.outcomes import Outcome
from hil.values.signals import signal_value, valid_values

_JOINTS: Final = 7
_ZERO_TORQUE: Final = (0.0,) * _JOINTS
_ZERO_WRENCH: Final = (0.0,) * 6
_NOTHING: Final = CommandData()


def admitted(release: Release, message: MonitoringMessage) -> tuple[FriState, CommandData | None]:
    """Return the state in ``message`` and what mirrors it, None in IDLE.

    Raises :class:`MalformedDatagram` for a message that could not even be mirrored.
    """
    connection = message.connection
    if connection is None:
        raise _shape("no connection information")
    try:
        session_state, quality = SessionState(connection.session_state), Quality(connection.quality)
    except ValueError as error:
        raise _shape(str(error)) from None
    monitor, ipo = message.monitor, message.ipo
    # The first five fields of MonitorData are its joint vectors.
    for values in (*(() if monitor is None else monitor[:5]), None if ipo is None else ipo.position):
        if values is not None and len(values) != _JOINTS:
            raise _shape(f"a joint vector of {len(values)} values")
    state = FriState(release, message, session_state, quality)
    try:
        return state, None if session_state is SessionState.IDLE else _mirror(state)
    except NotAvailable as error:
        raise _shape(str(error)) from None


def command_data(state: FriState, mirror: CommandData, command: Command | None) -> CommandData | None:
    """Return what the answer to ``state`` carries beside its header: ``command``, and ``mirror`` where it is silent.

    None: the answer is a header alone.
    """
    if command is not None and not command.mirror:
        mirror = _NOTHING
    data = mirror if command is None else _overlaid(state, mirror, command)
    # Not compared with an empty one: an author's vector may be an array, which does not compare to one truth value.
    vectors = (data.position, data.wrench, data.torque, data.pose, data.redundancy)
    silent = all(part is None for part in vectors) and not (data.transformations or data.inputs_outputs)
    return None if silent else data


def _mirror(state: FriState) -> CommandData:
    if state.session_state < SessionState.COMMANDING_WAIT:
        return CommandData(state.commanded_position_rad if TRAITS[state.release].commanded_position else None)
    mode = state.client_command_mode
    ipo = state.message.ipo
    if mode is ClientCommandMode.CARTESIAN_POSE and ipo is not None:
        pose = Transformation("" if ipo.pose is None else ipo.pose.name, state.interpolator_pose)
        return CommandData(pose=pose, redundancy=ipo.redundancy)
    # Both other modes want their zeros already in COMMANDING_WAIT, beside the position: so do the recorded clients.
    return CommandData(
        state.interpolator_position_rad,
        wrench=_ZERO_WRENCH if mode is ClientCommandMode.WRENCH else None,
        torque=_ZERO_TORQUE if mode is ClientCommandMode.TORQUE else None,
    )


def _overlaid(state: FriState, mirror: CommandData, command: Command) -> CommandData:
    if (command.pose is not None or command.e1_rad is not None) and not TRAITS[state.release].pose:
        raise NotAvailable("pose command", release=state.release, state=state.session_state, reason="only 2.x takes it")
    name = "" if mirror.pose is None else mirror.pose.name
    return CommandData(
        _given(command.joint_position_rad, mirror.position),
        _given(command.wrench, mirror.wrench),
        _given(command.torque_nm, mirror.torque),
        _transformations(state, command.transformations),
        _outputs(state, command.outputs) if command.outputs else (),
        mirror.pose if command.pose is None else Transformation(name, command.pose),
        mirror.redundancy if command.e1_rad is None else Redundancy(RedundancyStrategy.E1, command.e1_rad),
    )


def _given(values: Vector | None, otherwise: Vector | None) -> Vector | None:
    return otherwise if values is None else values


def _outputs(state: FriState, values: Mapping[str, bool | int | float]) -> tuple[IOValue, ...]:
    listed = {io.name: io for io in state.inputs_outputs}
    return tuple(_output(listed, name, value) for name, value in values.items())


def _output(listed: Mapping[str, IOValue], name: str, value: float) -> IOValue:
    outputs = [io.name for io in listed.values() if io.direction == IODirection.OUTPUT]
    if name not in listed:
        raise UnknownName("output", name, outputs)
    kind = listed[name].type
    if name not in outputs:
        raise WrongSignal(name, f"it is an input, which a client cannot set; outputs: {', '.join(outputs) or 'none'}")
    try:
        named = IOType(kind)
    except ValueError:
        raise WrongSignal(name, f"it is {io_type_name(kind)}, which names nothing") from None
    if named is IOType.DIGITAL:
        # A whole number of numpy is no int.
        with contextlib.suppress(TypeError):
            value = operator.index(value)  # type: ignore[arg-type]
    taken = signal_value(named, value)
    if taken is None:
        raise WrongSignal(name, f"it is {io_type_name(kind)} and cannot be {value!r}; valid: {valid_values(named)}")
    if named is IOType.ANALOG:
        return IOValue(name, kind, IODirection.OUTPUT, analog=float(taken))
    return IOValue(name, kind, IODirection.OUTPUT, digital=int(taken))


def _transformations(state: FriState, values: tuple[Transformation, ...]) -> tuple[Transformation, ...]:
    if not values:
        return ()
    requested = [transformation.name for transformation in state.requested_transformations]
    want = TRAITS[state.release].transformation_values
    for transformation in values:
        if transformation.name not in requested:
            raise UnknownName("requested transformation", transformation.name, requested)
        if len(transformation.values) != want:
            raise CommandShape(f"transformation {transformation.name!r}", got=len(transformation.values), want=want)
    return values


def _shape(detail: str) -> MalformedDatagram:
    return MalformedDatagram(Outcome.SHAPE, detail)
