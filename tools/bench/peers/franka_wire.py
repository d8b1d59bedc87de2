"""As much of the network protocol of libfranka (robot server version 10) as a client needs to see the state stream and
to move the arm by joint positions. No socket and no clock; little endian everywhere.

A client connects over TCP and names its UDP port; states then come there each millisecond, and commands go back to
where they come from. It runs in our environment and in the peer's, so it needs nothing but Python.
"""

import struct
from typing import Final, NamedTuple

COMMAND_PORT: Final = 1337
"""TCP, fixed by the protocol."""
ROBOT_SERVER_VERSION: Final = 10
MOTION_STARTED: Final = 1
"""Status of the answer to a move that begins."""
_HEADER: Final = struct.Struct("<III")
_CONNECT: Final = 0
_MOVE: Final = 1
_JOINT_IMPEDANCE: Final = 0
_JOINT_POSITION: Final = 0
_STATE_COUNTER: Final = struct.Struct("<Q")
_FLOATS_BEFORE_POSITION: Final = 6 * 16 + 2 * (1 + 9 + 3) + 2 * 2 + 3 * 7
"""Six transformations, mass properties of the tool and the load, the elbow twice, three vectors of torques."""
_POSITION: Final = struct.Struct("<7f")
_POSITION_AT: Final = _STATE_COUNTER.size + 4 * _FLOATS_BEFORE_POSITION
_COMMAND: Final = struct.Struct("<Q7d7d16d6d2d??7d?")
_NO_VELOCITY: Final = (0.0,) * 7
_NO_POSE: Final = (0.0,) * 16
_NO_TWIST: Final = (0.0,) * 6
_NO_ELBOW: Final = (0.0,) * 2
_NO_TORQUE: Final = (0.0,) * 7


class Answer(NamedTuple):
    """What a TCP answer says: to which request, and with which status."""

    request: int
    status: int


def connect_request(udp_port: int) -> bytes:
    """Return the first request: states are wanted at this port."""
    return _request(_CONNECT, 1, struct.pack("<HH", ROBOT_SERVER_VERSION, udp_port))


def move_request(request: int) -> bytes:
    """Return the request to follow joint positions under joint impedance, without bounds on deviations."""
    return _request(_MOVE, request, struct.pack("<II6d", _JOINT_IMPEDANCE, _JOINT_POSITION, *(0.0,) * 6))


def read_answer(received: bytes) -> tuple[Answer, bytes] | None:
    """Return the first answer in what was received and the rest, or None if it is not complete."""
    if len(received) < _HEADER.size:
        return None
    _, request, size = _HEADER.unpack_from(received)
    if len(received) < size or size <= _HEADER.size:
        return None
    return Answer(request, received[_HEADER.size]), received[size:]


def state_counter(state: bytes) -> int:
    """Return the number of a state packet; each has the next one."""
    counter: int = _STATE_COUNTER.unpack_from(state)[0]
    return counter


def measured_position_rad(state: bytes) -> tuple[float, ...]:
    """Return the measured joint positions in a state packet."""
    return _POSITION.unpack_from(state, _POSITION_AT)


def position_answer(state: bytes, position_rad: tuple[float, ...]) -> bytes:
    """Return the command that answers ``state``: it carries that state's number, or it would count as a late one."""
    return position_command(state_counter(state), position_rad)


def position_command(counter: int, position_rad: tuple[float, ...]) -> bytes:
    """Return the command that answers the state numbered ``counter`` with joint positions."""
    return _COMMAND.pack(
        counter,
        *position_rad,
        *_NO_VELOCITY,
        *_NO_POSE,
        *_NO_TWIST,
        *_NO_ELBOW,
        False,
        False,
        *_NO_TORQUE,
        False,
    )


def _request(kind: int, number: int, payload: bytes) -> bytes:
    return _HEADER.pack(kind, number, _HEADER.size + len(payload)) + payload
