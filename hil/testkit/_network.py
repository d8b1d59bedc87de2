"""The network between application and virtual controller: faults can be armed and disarmed while datagrams pass."""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import Final, Generic, NamedTuple, TypeVar

from hil.values.errors import UsageError
from transport.impairment import Direction, Fault, FaultReport, Network, PacketId, parse_fault

ROUTES_REMEMBERED: Final = 65_536
"""Of so many packets the way is known, more than any network holds back; what is older than that goes nowhere."""

_Route = TypeVar("_Route")


class Arrived(NamedTuple, Generic[_Route]):
    """A datagram that comes out at ``at_ns``, and where it is to go."""

    at_ns: int
    datagram: bytes
    route: _Route


class _Stage(Generic[_Route]):
    """Faults that were armed together, and the ways of the packets in there."""

    def __init__(self, faults: Sequence[Fault], seed: int) -> None:
        self.network = Network(faults, seed=seed)
        self.armed = True
        self._routes: OrderedDict[PacketId, _Route] = OrderedDict()

    def send(self, datagram: bytes, direction: Direction, route: _Route, *, now_ns: int) -> None:
        self._routes[PacketId(direction, self.network.packets[direction])] = route
        if len(self._routes) > ROUTES_REMEMBERED:
            self._routes.popitem(last=False)
        self.network.send(datagram, direction, now_ns=now_ns)

    def due(self, *, now_ns: int) -> list[tuple[Direction, Arrived[_Route]]]:
        return [
            (delivery.direction, Arrived(delivery.at_ns, delivery.datagram, self._routes[delivery.packet]))
            for delivery in self.network.due(now_ns=now_ns)
            if delivery.packet in self._routes
        ]


class VirtualNetwork(Generic[_Route]):
    """Carries datagrams in virtual time; perfect until a fault is armed.

    What is armed together meets a datagram as :class:`transport.impairment.Network` says. What is armed later is
    another stretch of the same way, behind the ones before. ``packets`` counts from the beginning, a fault's packets
    from when it was armed.
    """

    def __init__(self, *, latency_ns: int, seed: int = 0) -> None:
        self.packets = dict.fromkeys(Direction, 0)
        """How many datagrams entered in each direction, those that were lost too."""
        self._latency_ns = latency_ns
        self._seed = seed
        self._stages: list[_Stage[_Route]] = []
        self._last: _Stage[_Route] = _Stage((), seed)
        """Perfect, and takes the time that even a perfect network takes."""

    def arm(self, *faults: Fault | str, seed: int | None = None) -> None:
        """Let ``faults`` hold from now on; the same ``seed`` gives the same again (default: the controller's).

        A text is one as ``hil impair --fault`` takes it. Raises :class:`UsageError` for what is none.
        """
        if not faults:
            raise UsageError("no fault to arm; give at least one, for example Loss(0.02)")
        read = [parse_fault(fault) if isinstance(fault, str) else fault for fault in faults]
        for fault in read:
            if not isinstance(fault, Fault):
                raise UsageError(f"{fault!r} is no fault; see hil.testkit for all of them, for example Loss(0.02)")
        self._stages.append(_Stage(read, self._seed if seed is None else seed))

    def disarm(self) -> None:
        """Let no fault hold from now on; what is on its way still comes. Reports stay."""
        for stage in self._stages:
            stage.armed = False

    def reports(self) -> tuple[FaultReport, ...]:
        """Return what each fault did that was ever armed; ``str`` says it in words."""
        return tuple(report for stage in self._stages for report in stage.network.reports())

    def require_fired(self) -> None:
        """Raise :class:`transport.impairment.FaultNeverFired` if a fault that was armed did nothing."""
        for stage in self._stages:
            stage.network.require_fired()

    def send(self, datagram: bytes, direction: Direction, route: _Route, *, now_ns: int) -> None:
        """Let a datagram enter."""
        self.packets[direction] += 1
        self._go_on(0, datagram, direction, route, now_ns)

    def next_due_ns(self) -> int | None:
        """Return when the next datagram comes out, or goes on; None while none is on the way."""
        due_ns = self._last.network.next_due_ns()
        for stage in self._stages:
            at_ns = stage.network.next_due_ns()
            if at_ns is not None and (due_ns is None or at_ns < due_ns):
                due_ns = at_ns
        return due_ns

    def deliver(self, take: Callable[[Direction, Arrived[_Route]], None], *, now_ns: int) -> None:
        """Hand over what has come out by ``now_ns``, in the order of time in each direction."""
        for number, stage in enumerate(self._stages, start=1):
            for direction, arrived in stage.due(now_ns=now_ns):
                self._go_on(number, arrived.datagram, direction, arrived.route, arrived.at_ns)
        for direction, arrived in self._last.due(now_ns=now_ns):
            take(direction, arrived)

    def _go_on(self, number: int, datagram: bytes, direction: Direction, route: _Route, at_ns: int) -> None:
        """Let a datagram enter the first armed stage from ``number`` on, or the last one."""
        for stage in self._stages[number:]:
            if stage.armed:
                stage.send(datagram, direction, route, now_ns=at_ns)
                return
        self._last.send(datagram, direction, route, now_ns=at_ns + self._latency_ns)
