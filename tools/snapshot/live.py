"""Where running robots are now, from their controllers; it only looks."""

from pathlib import Path
from typing import Final, NamedTuple

from hil.client.servo import Role, ServoClient, load_key
from hil.values.arm import seven
from hil.values.robot import Seven

_PATIENCE_S: Final = 2.0


class Seen(NamedTuple):
    """What a controller says of its robot."""

    model: str
    position_rad: Seven


def look_at(controller: str, *, key_file: Path | None = None) -> Seen:
    """Return the robot of the controller at ``HOST[:PORT]``, and its measured position.

    Raises :class:`EndpointError` when nobody answers within 2 s.
    """
    key = None if key_file is None else load_key(key_file)
    with ServoClient(
        controller, name="hil snapshot", role=Role.OBSERVER, key=key, connect_timeout_s=_PATIENCE_S
    ) as client:
        return Seen(client.controller.robot, seven(client.read_state().measured_position))
