"""An FRI client that lays a slow sine over axis 4: ``python -m cell.sway``."""

import math
import sys

from hil.client.fri import ANY_HOST, CLIENT_PORT, Command, FriClient, FriHandler, FriState, Release, SessionState

AXIS = 3
"""A4."""
SETTLING_S = 0.5
"""The sine grows to its size in about so long, so that it begins without a jerk."""


class Sway(FriHandler):
    """Adds a sine of ``amplitude_rad`` to the interpolator's position; each motion begins at rest."""

    def __init__(self, *, amplitude_rad: float = 0.05, frequency_hz: float = 0.25) -> None:
        self.amplitude_rad = amplitude_rad
        self.frequency_hz = frequency_hz
        self.motions = 0
        """Motions begun."""
        self._time_s = 0.0

    def on_state_change(self, old: SessionState, new: SessionState) -> None:
        """A new motion begins at the interpolator's position, wherever the last one was interrupted."""
        self._time_s = 0.0
        self.motions += new is SessionState.COMMANDING_ACTIVE

    def command(self, state: FriState) -> Command:
        """Return the interpolator's position with the sine on it."""
        self._time_s += state.sample_time_s
        grown = 1.0 - math.exp(-self._time_s / SETTLING_S)
        position = list(state.interpolator_position_rad)
        position[AXIS] += grown * self.amplitude_rad * math.sin(2.0 * math.pi * self.frequency_hz * self._time_s)
        return Command(joint_position_rad=tuple(position))


def run(sway: Sway, *, seconds: float, bind_host: str = ANY_HOST, port: int = CLIENT_PORT) -> int:
    """Sway for so long, or until the controller closes the session; return how many messages were answered."""
    with FriClient(sway, release=Release.V2_5, bind_host=bind_host, port=port) as client:
        client.run(duration_s=seconds)
        return client.session.answered


if __name__ == "__main__":
    sys.exit(0 if run(Sway(), seconds=60.0) else 1)
