"""How a TCP responder behaves towards the doctor that measures it."""

from enum import StrEnum


class Behaviour(StrEnum):
    """What kind of peer the responder is. Only the good one does what the doctor asks of its socket."""

    GOOD = "good"
    """TCP_NODELAY, an acknowledgement at once (TCP_QUICKACK after every receive, Linux), one write a reply."""
    NAGLE = "nagle"
    """Replies in two writes with Nagle's algorithm on; it acknowledges at once."""
    DELAYED_ACK = "delayed-ack"
    """It leaves acknowledgements to its kernel, which delays them: about 40 ms on Linux."""
    DELAYED_ACK_200MS = "delayed-ack-200ms"
    """Emulated: as ``delayed-ack``, and where a request came in parts because its second one had to wait, the reply is
    held until 200 ms after the first part, and the figures told say so. From outside that is a peer that acknowledges
    after 200 ms, as Windows does; its acknowledgements on the wire are those of its kernel."""
