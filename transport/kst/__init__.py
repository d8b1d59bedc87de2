"""The text protocol of the KST toolbox and its Python sibling, over TCP: lines in, lines out.

A request is a line: fields joined by ``_``, of which the first is the command. Empty fields, a trailing ``_`` and empty
lines mean nothing. A reply is ``done``, ``nak``, ``interrupted`` or a list of numbers, each followed by ``_``; it goes
out in one write, because published clients take what one ``recv`` gives for the whole reply. Some requests have none.
Joints in rad, A1 to A7; positions in mm, angles in rad as A, B, C; torques in Nm.
"""

from transport.kst.commands import (
    AXES,
    COMMANDS,
    Command,
    Feedback,
    Problem,
    Refused,
    Request,
    Served,
    Spec,
    read_request,
    shown,
)
from transport.kst.lines import LINE_MOST_BYTES, LineCutter
from transport.kst.numbers import java_double, java_text
from transport.kst.replies import DONE, INTERRUPTED, NAK, REPLY_MOST_BYTES, pin_reply, values_reply

__all__ = [
    "AXES",
    "COMMANDS",
    "DONE",
    "INTERRUPTED",
    "LINE_MOST_BYTES",
    "NAK",
    "REPLY_MOST_BYTES",
    "Command",
    "Feedback",
    "LineCutter",
    "Problem",
    "Refused",
    "Request",
    "Served",
    "Spec",
    "java_double",
    "java_text",
    "pin_reply",
    "read_request",
    "shown",
    "values_reply",
]
