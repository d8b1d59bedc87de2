"""The packets of nearly every cycle: commands with one new destination or none, and states.

Both ends write them as the layouts here. What is read here is what protobuf would read, and a test holds both ways
equal on whole and on broken bytes; anything else is None and goes the ordinary way. A command with a destination is
read in 1.4 us instead of 4.4, a state with a motion in 6 instead of 11.
"""

from typing import Any, Final

from hil.values.arm import MAX_CONTACTS, Contact
from hil.values.errors import MalformedDatagram
from hil.values.operator import OperatorView
from hil.values.pose import Pose
from hil.values.servo import (
    MAX_COMMANDER_BYTES,
    MAX_MOTIONS_IN_PACKET,
    MAX_REASON_BYTES,
    MAX_REPORTS_IN_PACKET,
    PROTOCOL_VERSION,
    Command,
    MotionState,
    RequestDone,
    RequestError,
    SetDestination,
    Snapshot,
    State,
)
from transport.servo.fields import (
    CONTROL_MODES,
    INTERPOLATORS,
    KINDS,
    MODES,
    MOST_OVERRIDE_PERCENT,
    PHASES,
    PROGRAMS,
    SAFETY_STATES,
    finite_pose_numbers,
    pose_numbers,
    pose_of,
)
from transport.servo.layout import Layout

_SIX: Final = 6
_SEVEN: Final = 7
_LOW: Final = 0x7F
_MORE: Final = 0x80

_VERSION: Final = b"\x0a\x1d\x08" + bytes((PROTOCOL_VERSION,)) + b"\x11"
_HEADER_PARTS: Final = (_VERSION, "Q", b"\x19", "Q", b"\x21", "Q")
_HEADER: Final = Layout(*_HEADER_PARTS)
"""Packet.header: token, sequence, reflected sequence."""
_POSITION: Final = (b"\x12\x3a\x0a\x38", "7d")
_VELOCITY: Final = (b"\x1a\x3a\x0a\x38", "7d")
_NO_REQUEST: Final = Layout(*_HEADER_PARTS, b"\x2a\x0b\x09", "Q", b"\x10", "B")
"""A command: header, reports seen, whether a state is wanted."""
_DESTINATION: Final = Layout(
    *_HEADER_PARTS, b"\x2a\x5d\x09", "Q", b"\x10", "B", b"\x1a\x50\x09", "Q", b"\x1a\x45\x09", "Q", *_POSITION
)  # fmt: skip
"""And a request for a new destination: number, motion, position."""
_VELOCITY_TOO: Final = Layout(
    *_HEADER_PARTS, b"\x2a\x9b\x01\x09", "Q", b"\x10", "B", b"\x1a\x8d\x01\x09", "Q", b"\x1a\x81\x01\x09", "Q",
    *_POSITION, *_VELOCITY,
)  # fmt: skip
_FLANGE: Final = (b"\x22\x3a\x0a\x38", "7d")
_POSE: Final = Layout(
    *_HEADER_PARTS, b"\x2a\x5d\x09", "Q", b"\x10", "B", b"\x1a\x50\x09", "Q", b"\x1a\x45\x09", "Q", *_FLANGE
)  # fmt: skip
"""A destination as a pose instead: as long as one in axis positions, and another tag."""
_COMMANDS: Final = {layout.size: layout for layout in (_NO_REQUEST, _DESTINATION, _VELOCITY_TOO)}
_FLANGE_TAG_AT: Final = _POSE.size - 60
"""Where the tag is that tells the two."""

_SNAPSHOT_PARTS: Final = (
    b"\x09", "q", b"\x11", "Q",
    b"\x18", "B", b"\x20", "B", b"\x28", "B", b"\x31", "d", b"\x38", "B", b"\x40", "B",
    b"\x4a\x38", "7d", b"\x52\x38", "7d", b"\x5a\x38", "7d", b"\x62\x38", "7d", b"\x82\x01\x3a\x0a\x38", "7d",
    b"\x88\x01", "B", b"\x92\x01\x1c", "7f", b"\x9a\x01\x18", "6f", b"\xa2\x01\x18", "6f",
    b"\xad\x01", "f",
)  # fmt: skip
_SNAPSHOT: Final = Layout(*_SNAPSHOT_PARTS)
"""A snapshot up to the commander: time, cycle, what the operator's pad shows, the vectors, the flange and its speed."""
_STATE_HEAD: Final = Layout(*_HEADER_PARTS, b"\x3a", "2B", b"\x09", "Q")
"""A state up to the snapshot: header, length, requests done."""
STATE_HEAD_BYTES: Final = _STATE_HEAD.size
_STATE: Final = Layout(*_HEADER_PARTS, b"\x3a", "2B", b"\x09", "Q", b"\x12", "2B", *_SNAPSHOT_PARTS)
_STATE_START: Final = _HEADER.size + 3
_SNAPSHOT_START: Final = _STATE.size - _SNAPSHOT.size
COMMANDER: Final = b"\x6a"
OPERATOR_REASON: Final = b"\x72"
_MOTION: Final = Layout(
    b"\x7a\x88\x01\x09", "Q", b"\x10", "B", b"\x18", "B", b"\x20", "B", b"\x2a\x38", "7d", b"\x31", "q", b"\x39", "d",
    b"\x41", "Q", b"\x49", "Q", b"\x51", "Q", b"\x59", "Q", b"\x61", "q",
)  # fmt: skip
"""Snapshot.motion, field by field."""
_CONTACT: Final = Layout(b"\xb2\x01\x1c\x0a\x0c", "3f", b"\x12\x0c", "3f")
"""Snapshot.contact: point and force."""
_REQUEST_TAKEN: Final = Layout(b"\x1a\x1f\x09", "Q", b"\x11", "q", b"\x1a\x0b\x09", "Q", b"\x10\x00")
"""State.report of a request that was taken: number, time, request."""


def read_command(packet: bytes) -> Command | None:
    """Return the command in ``packet``, if it asks for one destination or for none."""
    layout = _COMMANDS.get(len(packet))
    if layout is _DESTINATION and packet[_FLANGE_TAG_AT] == _FLANGE[0][0]:
        layout = _POSE
    numbers = None if layout is None else layout.unpack(packet)
    if numbers is None or numbers[4] > 1:
        return None
    requests: tuple[SetDestination, ...] = ()
    if layout is _DESTINATION:
        requests = (SetDestination(numbers[5], numbers[6], numbers[7:]),)
    elif layout is _POSE:
        flange_in_base = _pose(numbers[7:])
        if flange_in_base is None:
            return None
        requests = (SetDestination(numbers[5], numbers[6], None, None, flange_in_base),)
    elif layout is _VELOCITY_TOO:
        requests = (SetDestination(numbers[5], numbers[6], numbers[7:14], numbers[14:]),)
    return Command(numbers[0], numbers[1], numbers[2], numbers[3], numbers[4] == 1, requests)


def write_header(command: Command) -> bytes:
    """Return the header of a command."""
    return _HEADER.pack(
        _VERSION, command.token, b"\x19", command.sequence, b"\x21", command.reflected_sequence
    )  # fmt: skip


def write_command(command: Command) -> bytes | None:
    """Return the packet of a command, if it asks for one destination or for none."""
    token, sequence, reflected, seen, wanted, requests = command
    header = (_VERSION, token, b"\x19", sequence, b"\x21", reflected)
    if not requests:
        return _NO_REQUEST.pack(*header, b"\x2a\x0b\x09", seen, b"\x10", wanted)
    request = requests[0]
    if len(requests) > 1 or not isinstance(request, SetDestination):
        return None
    number, motion, position, velocity, flange_in_base = request
    if flange_in_base is None and velocity is None:
        if position is None or len(position) != _SEVEN:
            return None
        return _DESTINATION.pack(
            *header, b"\x2a\x5d\x09", seen, b"\x10", wanted, b"\x1a\x50\x09", number, b"\x1a\x45\x09", motion,
            _POSITION[0], *position,
        )  # fmt: skip
    return _write_rarer(header, request, seen, wanted=wanted)


def _write_rarer(header: tuple[Any, ...], request: SetDestination, seen: int, *, wanted: bool) -> bytes | None:
    """Return a command with a destination that is a pose, or has a velocity."""
    number, motion, position, velocity, flange_in_base = request
    if flange_in_base is not None:
        if position is not None or velocity is not None:
            return None
        return _POSE.pack(
            *header, b"\x2a\x5d\x09", seen, b"\x10", wanted, b"\x1a\x50\x09", number, b"\x1a\x45\x09", motion,
            _FLANGE[0], *finite_pose_numbers(flange_in_base),
        )  # fmt: skip
    if position is None or velocity is None or not len(position) == len(velocity) == _SEVEN:
        return None
    return _VELOCITY_TOO.pack(
        *header, b"\x2a\x9b\x01\x09", seen, b"\x10", wanted, b"\x1a\x8d\x01\x09", number, b"\x1a\x81\x01\x09", motion,
        _POSITION[0], *position, _VELOCITY[0], *velocity,
    )  # fmt: skip


def read_state(packet: bytes) -> State | None:
    """Return the state in ``packet``, if its motions all have destinations and its reports are of requests taken."""
    numbers = _STATE.unpack(packet)
    if numbers is None or _STATE_START + _length(numbers[3], numbers[4]) != len(packet):
        return None
    end = _SNAPSHOT_START + _length(numbers[6], numbers[7])
    commander, at = _read_text(packet, _STATE.size, COMMANDER, MAX_COMMANDER_BYTES)
    reason, at = _read_text(packet, at, OPERATOR_REASON, MAX_REASON_BYTES)
    operator = _operator(numbers[10:16], reason)
    flange_in_base, control_mode = _pose(numbers[44:51]), CONTROL_MODES.get(numbers[51])
    if commander is None or operator is None or flange_in_base is None or control_mode is None or end > len(packet):
        return None
    motions, at = _read_motions(packet, at, end)
    contacts = () if at == end else _read_contacts(packet, at, end)
    reports = _read_reports(packet, end)
    if motions is None or contacts is None or reports is None:
        return None
    snapshot = Snapshot(
        numbers[8],
        numbers[9],
        operator,
        numbers[16:23],
        numbers[23:30],
        numbers[30:37],
        numbers[37:44],
        flange_in_base,
        control_mode,
        numbers[52:59],
        numbers[59:65],
        numbers[65:71],
        commander,
        motions,
        numbers[71],
        contacts,
    )
    return State(numbers[0], numbers[1], numbers[2], numbers[5], snapshot, reports)


def write_state(state: State, snapshot: bytes, reports: bytes) -> bytes:
    """Return the packet of a state, whose snapshot and reports are written already."""
    length = STATE_HEAD_BYTES - _STATE_START + len(snapshot) + len(reports)
    head = _STATE_HEAD.pack(
        _VERSION, state.token, b"\x19", state.sequence, b"\x21", state.reflected_sequence,
        b"\x3a", length & _LOW | _MORE, length >> 7, b"\x09", state.requests_done,
    )  # fmt: skip
    return b"".join((head, snapshot, reports))


def write_snapshot(snapshot: Snapshot) -> bytes | None:
    """Return a snapshot up to the commander, if it is of an arm with seven axes."""
    measured, commanded = snapshot.measured_position, snapshot.commanded_position
    torque, external = snapshot.measured_torque, snapshot.external_torque
    variance, force, force_variance = (
        snapshot.external_torque_variance,
        snapshot.flange_force,
        snapshot.flange_force_variance,
    )
    if not len(measured) == len(commanded) == len(torque) == len(external) == len(variance) == _SEVEN:
        return None
    if not len(force) == len(force_variance) == _SIX:
        return None
    mode, program, enabling, override_percent, safety_state, _, permissive = snapshot.operator
    try:
        return _SNAPSHOT.pack(
            b"\x09", snapshot.now_ns, b"\x11", snapshot.cycle,
            b"\x18", mode, b"\x20", program, b"\x28", enabling, b"\x31", override_percent,
            b"\x38", safety_state, b"\x40", permissive,
            b"\x4a\x38", *measured, b"\x52\x38", *commanded, b"\x5a\x38", *torque, b"\x62\x38", *external,
            b"\x82\x01\x3a\x0a\x38", *pose_numbers(snapshot.flange_in_base),
            b"\x88\x01", snapshot.control_mode, b"\x92\x01\x1c", *variance,
            b"\x9a\x01\x18", *force, b"\xa2\x01\x18", *force_variance,
            b"\xad\x01", snapshot.flange_speed_mm_s,
        )  # fmt: skip
    except OverflowError:
        # No single: protobuf makes it infinite.
        return None


def write_motion(motion: MotionState) -> bytes | None:
    """Return a motion of a snapshot, if it has a destination."""
    if len(motion.destination) != _SEVEN:
        return None
    (
        number, kind, phase, interpolator, destination, destination_at_ns, remaining_s, goals_reached,
        received, superseded, executed, executed_at_ns,
    ) = motion  # fmt: skip
    return _MOTION.pack(
        b"\x7a\x88\x01\x09", number, b"\x10", kind, b"\x18", phase, b"\x20", interpolator, b"\x2a\x38", *destination,
        b"\x31", destination_at_ns, b"\x39", remaining_s, b"\x41", goals_reached, b"\x49", received,
        b"\x51", superseded, b"\x59", executed, b"\x61", executed_at_ns,
    )  # fmt: skip


def write_contact(contact: Contact) -> bytes | None:
    """Return a contact of a snapshot."""
    try:
        return _CONTACT.pack(b"\xb2\x01\x1c\x0a\x0c", *contact.point_m, b"\x12\x0c", *contact.force_n)
    except OverflowError:
        # No single: protobuf makes it infinite.
        return None


def write_request_taken(done: RequestDone) -> bytes | None:
    """Return the report of a request, if it was taken and there is nothing more to say."""
    if done.error is not RequestError.NONE or done.reason or done.detail:
        return None
    return _REQUEST_TAKEN.pack(
        b"\x1a\x1f\x09", done.number, b"\x11", done.at_ns, b"\x1a\x0b\x09", done.request, b"\x10\x00"
    )


def _pose(numbers: tuple[float, ...]) -> Pose | None:
    try:
        return pose_of(numbers)
    except MalformedDatagram:
        return None


def _read_text(packet: bytes, at: int, tag: bytes, most_bytes: int) -> tuple[str | None, int]:
    """Return the text of the field ``tag``, empty if it is not there, and where the next field begins.

    The text is None where it is too long, cut off or no UTF-8.
    """
    if packet[at : at + 1] != tag:
        return "", at
    start = at + 2
    if start > len(packet):
        return None, at
    size = packet[at + 1]
    if size >= _MORE:
        if start == len(packet):
            return None, at
        size = _length(size, packet[start])
        start += 1
    end = start + size
    if not 0 <= size <= most_bytes or end > len(packet):
        return None, at
    try:
        return packet[start:end].decode(), end
    except UnicodeDecodeError:
        return None, at


def _operator(numbers: tuple[Any, ...], reason: str | None) -> OperatorView | None:
    mode, program, enabling, override_percent, safety_state, permissive = numbers
    if reason is None or enabling > 1 or permissive > 1 or not 0.0 <= override_percent <= MOST_OVERRIDE_PERCENT:
        return None
    try:
        return OperatorView(
            MODES[mode],
            PROGRAMS[program],
            enabling == 1,
            override_percent,
            SAFETY_STATES[safety_state],
            reason,
            permissive == 1,
        )
    except KeyError:
        return None


def _read_motions(packet: bytes, at: int, end: int) -> tuple[tuple[MotionState, ...] | None, int]:
    """Return the motions, None where they are none, and where the next field begins."""
    motions: list[MotionState] = []
    while at < end:
        numbers = _MOTION.unpack(packet, at)
        if numbers is None:
            break
        at += _MOTION.size
        kind, phase, interpolator = KINDS.get(numbers[1]), PHASES.get(numbers[2]), INTERPOLATORS.get(numbers[3])
        if kind is None or phase is None or interpolator is None:
            return None, at
        motions.append(MotionState(numbers[0], kind, phase, interpolator, numbers[4:11], *numbers[11:]))
    return (tuple(motions) if len(motions) <= MAX_MOTIONS_IN_PACKET else None), at


def _read_contacts(packet: bytes, at: int, end: int) -> tuple[Contact, ...] | None:
    contacts: list[Contact] = []
    while at < end:
        numbers = _CONTACT.unpack(packet, at)
        if numbers is None:
            return None
        at += _CONTACT.size
        contacts.append(Contact(numbers[:3], numbers[3:]))
    return tuple(contacts) if at == end and len(contacts) <= MAX_CONTACTS else None


def _read_reports(packet: bytes, at: int) -> tuple[RequestDone, ...] | None:
    reports: list[RequestDone] = []
    while at < len(packet):
        numbers = _REQUEST_TAKEN.unpack(packet, at)
        if numbers is None:
            return None
        at += _REQUEST_TAKEN.size
        reports.append(RequestDone(numbers[0], numbers[2], numbers[1]))
    return tuple(reports) if len(reports) <= MAX_REPORTS_IN_PACKET else None


def _length(low: int, high: int) -> int:
    """Return the length that two bytes say; -1 where they are no varint of two bytes."""
    return low & _LOW | high << 7 if low >= _MORE > high else -1
