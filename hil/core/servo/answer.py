"""What became of a request."""

from typing import NamedTuple

from hil.values.motion import Fault
from hil.values.servo import RequestError


class Answer(NamedTuple):
    """Taken, or refused for a kind of error and a reason."""

    error: RequestError = RequestError.NONE
    why: Fault = Fault("")
