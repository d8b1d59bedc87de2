"""Pushes of a simulated arm: what the pad and operators on the servo link ask for, checked and handed on."""

from hil.values.arm import Backend, Push
from hil.values.errors import ConfigurationError

NOT_PUSHED = "this robot side is no simulation that could be pushed from here"


class Pusher:
    """Hands legal pushes to the robot side."""

    def __init__(self, backend: Backend) -> None:
        self._backend = backend

    def push(self, push: Push) -> str:
        """Push the arm; return why that is not done, or an empty text."""
        if not self._backend.capabilities.can_be_pushed:
            return NOT_PUSHED
        try:
            push.check()
        except ConfigurationError as error:
            return str(error)
        self._backend.push(push)
        return ""
