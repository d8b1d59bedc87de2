"""Names of everything that can become of a received datagram: one counter each."""

from enum import StrEnum
from typing import Final


class Outcome(StrEnum):
    """What admission decided. ``ACCEPTED`` reached the motion; everything else is a named counter."""

    ACCEPTED = "accepted"
    STRANGER = "stranger"
    """Sent from an address or port that is not the peer."""
    TOO_LONG = "too_long"
    """More than 1500 bytes."""
    TOO_SHORT = "too_short"
    """Fewer bytes than the smallest message of the release."""
    FRAMING = "framing"
    """The length prefix or the CRC of release 2.7 does not fit the datagram."""
    UNDECODABLE = "undecodable"
    """Not a protobuf command message."""
    OTHER_RELEASE = "other_release"
    """A message, but with an identifier or fields the configured release does not have."""
    UNSENT_SEQUENCE = "unsent_sequence"
    """Reflects a monitoring message that was never sent."""
    DUPLICATE = "duplicate"
    """A second answer to the monitoring message answered last."""
    REORDERED = "reordered"
    """Overtaken by the answer to a later monitoring message."""
    REPLAYED = "replayed"
    """Answers a monitoring message that was answered before, or one too old to remember."""
    LATE = "late"
    """Older than the latency budget, or with a transformation whose time stamp is not of this second."""
    SHAPE = "shape"
    """A joint vector that has not seven values, or none where one is needed; a value that is none of its type."""
    NOT_FINITE = "not_finite"
    """NaN or infinity."""
    NOT_ALLOWED = "not_allowed"
    """What the running overlay does not take (a torque in a wrench overlay), outputs not listed, transformations not
    asked for."""
    AXIS_LIMIT = "axis_limit"
    """An axis position outside its range, or one from which the arm could not stop inside it."""
    AXIS_VELOCITY = "axis_velocity"
    """A step since the last accepted position that is faster than an axis may move."""
    TORQUE_LIMIT = "torque_limit"
    """A torque above what its axis has, or a wrench above what an overlay may add."""
    UNREACHABLE = "unreachable"
    """A Cartesian pose that the arm cannot take within its axis ranges, or one that does not determine them."""
    OTHER_VERSION = "other_version"
    """A servo link packet of another protocol version; a hello of one is answered in words."""
    UNAUTHENTICATED = "unauthenticated"
    """A servo link packet without the tag that the pre-shared key gives, or with one where there is no key."""
    UNKNOWN_SESSION = "unknown_session"
    """A servo link packet of no session, of one that ended, or from another address than the session's."""
    CROWDED = "crowded"
    """More than the controller takes at once: hellos, sessions or requests in one cycle; the client sends again."""


SERVO_DROPS: Final = (
    Outcome.TOO_LONG,
    Outcome.TOO_SHORT,
    Outcome.UNDECODABLE,
    Outcome.OTHER_VERSION,
    Outcome.UNAUTHENTICATED,
    Outcome.UNKNOWN_SESSION,
    Outcome.DUPLICATE,
    Outcome.REORDERED,
    Outcome.LATE,
    Outcome.CROWDED,
)
"""What may become of a packet of the servo link, beside ``ACCEPTED``."""

_SERVO_ONLY = {Outcome.OTHER_VERSION, Outcome.UNAUTHENTICATED, Outcome.UNKNOWN_SESSION, Outcome.CROWDED}
FRI_DROPS: Final = tuple(outcome for outcome in Outcome if outcome not in {Outcome.ACCEPTED, *_SERVO_ONLY})
"""What may become of an answer of an FRI client, beside ``ACCEPTED``."""
