"""FRI clients in Python, for all six releases, against this emulator or a real controller.

Override the callbacks of :class:`FriHandler`; what you leave alone mirrors the interpolator, as the vendor's library
does. A release is configured, never guessed. A client that raises axis 4 by a hundredth of a radian::

    from hil.client.fri import Command, FriClient, FriHandler, FriState, Release, SessionState

    class Raise(FriHandler):
        raised_rad = 0.0

        def on_state_change(self, old: SessionState, new: SessionState) -> None:
            self.raised_rad = 0.0  # each motion begins at the interpolator position

        def command(self, state: FriState) -> Command:
            self.raised_rad = min(self.raised_rad + 0.02 * state.sample_time_s, 0.01)  # 0.02 rad/s
            position = list(state.interpolator_position_rad)
            position[3] += self.raised_rad
            return Command(joint_position_rad=tuple(position))

    with FriClient(Raise(), release=Release.V1_15) as client:
        client.run(duration_s=10, silence_s=1)

:class:`AsyncFriClient` is the same with ``async with`` and ``await client.run()``; :class:`ClientSession` is what both
are around: datagrams in, answers out, no socket and no clock.
"""

from hil.client.fri.asynchronous import AsyncFriClient
from hil.client.fri.blocking import FriClient
from hil.client.fri.command import Command
from hil.client.fri.errors import CommandShape, NotAvailable, NothingHeard, WrongSignal
from hil.client.fri.handler import FriHandler
from hil.client.fri.session import ClientSession
from hil.client.fri.state import FriState
from hil.client.fri.transformations import make_transformation
from hil.values.errors import EndpointError, HilError, UsageError
from hil.values.fri import (
    CLIENT_PORT,
    ClientCommandMode,
    ControlMode,
    DriveState,
    IODirection,
    IOType,
    OperationMode,
    OverlayType,
    Quality,
    Release,
    SafetyState,
    SessionState,
)
from hil.values.fri_messages import IOValue, Redundancy, TimeStamp, Transformation, Vector
from hil.values.link import Address
from hil.values.outcomes import Outcome
from transport.udp import ANY_HOST

__all__ = [
    "ANY_HOST",
    "CLIENT_PORT",
    "Address",
    "AsyncFriClient",
    "ClientCommandMode",
    "ClientSession",
    "Command",
    "CommandShape",
    "ControlMode",
    "DriveState",
    "EndpointError",
    "FriClient",
    "FriHandler",
    "FriState",
    "HilError",
    "IODirection",
    "IOType",
    "IOValue",
    "NotAvailable",
    "NothingHeard",
    "OperationMode",
    "Outcome",
    "OverlayType",
    "Quality",
    "Redundancy",
    "Release",
    "SafetyState",
    "SessionState",
    "TimeStamp",
    "Transformation",
    "UsageError",
    "Vector",
    "WrongSignal",
    "make_transformation",
]
