"""The callbacks of a client application, named as the vendor's library names them."""

from hil.client.fri.command import Command
from hil.client.fri.state import FriState
from hil.values.fri import SessionState


class FriHandler:
    """Override what you need; as it is, it answers as the vendor's library does when nothing is overridden.

    One of ``monitor``, ``wait_for_command`` and ``command`` is called for **every** monitoring message, also for those
    a receive multiplier leaves unanswered: the recorded clients integrate over all of them, with the send period
    (:attr:`FriState.sample_time_s`). An answer carries what the call for the answered message returned.
    """

    robot_state: FriState
    """The latest state, there before the first callback; for ``on_state_change``, which is not handed one."""

    def on_state_change(self, old: SessionState, new: SessionState) -> None:
        """Called once when the session state has changed, before the callback of ``new``; a session begins in IDLE."""

    def monitor(self, state: FriState) -> Command | None:  # noqa: ARG002  # it is the overriding one that reads it
        """Answer in MONITORING_WAIT and MONITORING_READY. None: the commanded position in 1.x, a header in 2.x."""
        return None

    def wait_for_command(self, state: FriState) -> Command | None:  # noqa: ARG002  # it is the overriding one that reads it
        """Answer in COMMANDING_WAIT. None: mirror; a position beside it keeps the controller from COMMANDING_ACTIVE."""
        return None

    def command(self, state: FriState) -> Command | None:  # noqa: ARG002  # it is the overriding one that reads it
        """Answer in COMMANDING_ACTIVE. None: mirror the interpolator."""
        return None
