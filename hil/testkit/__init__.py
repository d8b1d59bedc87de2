"""A test kit for applications: the controller under your tests, in virtual time, with every fault of a network.

It is a plugin of pytest, there as soon as fri-hil is installed::

    from hil.client.servo import PTP, ServoClient

    def test_the_arm_arrives(hil_controller):
        goal = [0.0, 0.6, 0.0, -1.5, 0.0, 0.9, 0.0]
        with ServoClient() as robot:
            robot.move(PTP(goal))
        assert max(abs(a - b) for a, b in zip(hil_controller.measured_position_rad, goal)) < 1e-4

Fixtures: ``hil_controller`` and ``hil_network`` (virtual time), ``hil_process`` (a controller process). Markers:
``hil`` (keys of the station file) and ``each_packet``. See ``docs/testing-your-application.md``.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hil.testkit._attached import AttachedApplication, AttachedFri
    from hil.testkit._network import VirtualNetwork
    from hil.testkit.controller import VirtualController
    from hil.testkit.errors import NeverHappened, ProcessFailed, VirtualTimeOver
    from hil.testkit.operator import Operator
    from hil.testkit.process import HilProcess
    from transport.impairment import (
        AtPacket,
        BurstLoss,
        ClockSkew,
        Corrupt,
        Delay,
        Direction,
        Distribution,
        Duplicate,
        FaultNeverFired,
        FaultReport,
        HalfOpen,
        Jitter,
        Loss,
        Rate,
        Reorder,
    )

__all__ = [
    "AtPacket",
    "AttachedApplication",
    "AttachedFri",
    "BurstLoss",
    "ClockSkew",
    "Corrupt",
    "Delay",
    "Direction",
    "Distribution",
    "Duplicate",
    "FaultNeverFired",
    "FaultReport",
    "HalfOpen",
    "HilProcess",
    "Jitter",
    "Loss",
    "NeverHappened",
    "Operator",
    "ProcessFailed",
    "Rate",
    "Reorder",
    "VirtualController",
    "VirtualNetwork",
    "VirtualTimeOver",
]

_HOMES = {
    "AttachedApplication": "hil.testkit._attached",
    "AttachedFri": "hil.testkit._attached",
    "HilProcess": "hil.testkit.process",
    "NeverHappened": "hil.testkit.errors",
    "Operator": "hil.testkit.operator",
    "ProcessFailed": "hil.testkit.errors",
    "VirtualController": "hil.testkit.controller",
    "VirtualNetwork": "hil.testkit._network",
    "VirtualTimeOver": "hil.testkit.errors",
}
"""The others are the network's."""


def __getattr__(name: str) -> Any:
    # Pytest imports the plugin, and this package with it, in every run: what takes its time comes when it is asked for.
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES.get(name, "transport.impairment")), name)
