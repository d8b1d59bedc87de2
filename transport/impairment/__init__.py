"""A seeded model of a bad network: faults as values, and what they do to datagrams.

Nothing here sends, waits or reads a clock: datagrams and times go in, datagrams and times come out. The core's tests
use it in virtual time, ``hil impair`` between real processes.
"""

from transport.impairment.faults import (
    AtPacket,
    BurstLoss,
    ClockSkew,
    Corrupt,
    Delay,
    Direction,
    Distribution,
    Duplicate,
    Fault,
    HalfOpen,
    Jitter,
    Loss,
    PacketAction,
    Rate,
    Reorder,
)
from transport.impairment.network import Delivery, Network
from transport.impairment.report import FaultNeverFired, FaultReport, PacketId
from transport.impairment.texts import FAULT_TEXTS, parse_fault

__all__ = [
    "FAULT_TEXTS",
    "AtPacket",
    "BurstLoss",
    "ClockSkew",
    "Corrupt",
    "Delay",
    "Delivery",
    "Direction",
    "Distribution",
    "Duplicate",
    "Fault",
    "FaultNeverFired",
    "FaultReport",
    "HalfOpen",
    "Jitter",
    "Loss",
    "Network",
    "PacketAction",
    "PacketId",
    "Rate",
    "Reorder",
    "parse_fault",
]
