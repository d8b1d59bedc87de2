"""``@pytest.mark.each_packet``: a test runs once undisturbed, and then once for each packet, with that packet hit.

Virtual time makes each repetition the same as the first run up to the packet that is hit, so every packet of the first
run is there to be hit in its repetition.
"""

import copy
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import pytest
from _pytest.runner import runtestprotocol

from hil.testkit._stash import OWN_ID, PACKETS, REPETITION
from hil.values.errors import ConfigurationError, UnknownName, UsageError
from transport.impairment import AtPacket, Direction, PacketAction

DEFAULT_DELAY_MS: Final = 20.0
MOST_FAILURES: Final = 10
"""Then a sweep stops: they have one cause, as a rule, or few."""
_ARGUMENTS: Final = ("direction", "every", "only", "delay_ms")


@dataclass(frozen=True, slots=True)
class Repetition:
    """One run of the test with one packet hit."""

    action: PacketAction
    direction: Direction
    index: int
    delay_ms: float

    @property
    def fault(self) -> AtPacket:
        """What is armed."""
        delay_ns = round(self.delay_ms * 1e6) if self.action is PacketAction.DELAY else None
        return AtPacket(self.action, self.index, self.direction, delay_ns=delay_ns)

    def __str__(self) -> str:
        return f"{self.action}-{self.direction}-{self.index}"


@dataclass(frozen=True, slots=True)
class Sweep:
    """What one mark asks for."""

    action: PacketAction
    directions: tuple[Direction, ...]
    every: int
    only: range | None
    delay_ms: float

    def repetitions(self, packets: Mapping[Direction, int]) -> Iterator[Repetition]:
        """Yield those for a first run with so many packets."""
        for direction in self.directions:
            for index in range(0, packets[direction], self.every):
                if self.only is None or index in self.only:
                    yield Repetition(self.action, direction, index, self.delay_ms)


@dataclass(frozen=True, slots=True)
class Which:
    """What ``--each-packet`` chooses; None: all."""

    action: PacketAction | None = None
    direction: Direction | None = None
    index: int | None = None
    none: bool = False

    @classmethod
    def parse(cls, text: str | None) -> "Which":
        """Read the option; raise :class:`UsageError`."""
        if text is None:
            return cls()
        if text == "none":
            return cls(none=True)
        *words, index = text.split(":")
        actions = [PacketAction(word) for word in words if word in set(PacketAction)]
        directions = [Direction(word) for word in words if word in set(Direction)]
        if not (index.isdecimal() and len(words) == len(actions) + len(directions)):
            raise _bad_choice(text)
        if len(actions) > 1 or len(directions) > 1:
            raise _bad_choice(text)
        return cls(actions[0] if actions else None, directions[0] if directions else None, int(index))

    def takes(self, repetition: Repetition) -> bool:
        """Whether ``repetition`` is one of those."""
        return (
            not self.none
            and self.action in {None, repetition.action}
            and self.direction in {None, repetition.direction}
            and self.index in {None, repetition.index}
        )


def sweeps_of(item: pytest.Item) -> list[Sweep]:
    """Return what the marks of a test ask for; raise :class:`UsageError`."""
    marks = list(item.iter_markers("each_packet"))
    # The closest comes first there, and a test's own from the lowest to the highest line.
    return [sweep for mark in reversed(marks) for sweep in _sweeps(mark)]


def repeat_for_each_packet(item: pytest.Item, nextitem: pytest.Item | None, sweeps: list[Sweep], which: Which) -> None:
    """Run ``item`` undisturbed, then its repetitions; report it once if all pass, else each repetition that failed."""
    hook = item.ihook
    hook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    # With a sibling as the next one, what has a wider scope than the test stays for the next repetition.
    sibling = copy.copy(item)
    first = _run(item, sibling)
    failures = 0
    ran = [report.when for report in first] == ["setup", "call", "teardown"]
    if not all(report.passed for report in first):
        first[-1].sections.append(("each_packet", "this was the undisturbed run, so no packet was hit"))
    elif ran:
        packets = item.stash[PACKETS]
        planned = [
            repetition for sweep in sweeps for repetition in sweep.repetitions(packets) if which.takes(repetition)
        ]
        if not planned and not which.none:
            first = [_nothing_to_hit(item, first, packets)]
        for number, repetition in enumerate(planned, start=1):
            reports = _repeat(item, sibling, repetition)
            first[1].duration += sum(report.duration for report in reports)
            if all(report.passed for report in reports):
                continue
            failures += 1
            _log_failure(item, reports, repetition, f"repetition {number} of {len(planned)}", last=failures)
            if failures == MOST_FAILURES or item.session.shouldfail or item.session.shouldstop:
                break
    if not failures:
        for report in first:
            hook.pytest_runtest_logreport(report=report)
    # What was kept for the next repetition and the next test does not need.
    item._report_sections.clear()
    call = pytest.CallInfo.from_call(lambda: item.session._setupstate.teardown_exact(nextitem), when="teardown")
    if call.excinfo is not None:
        hook.pytest_runtest_logreport(report=hook.pytest_runtest_makereport(item=item, call=call))
    hook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)


def _repeat(item: pytest.Item, sibling: pytest.Item, repetition: Repetition) -> list[pytest.TestReport]:
    item.stash[REPETITION] = repetition
    try:
        return _run(item, sibling)
    finally:
        del item.stash[REPETITION]


def _run(item: pytest.Item, sibling: pytest.Item) -> list[pytest.TestReport]:
    """Run a test with fresh fixtures, a fresh instance of its class, and nothing captured before."""
    # What pytest keeps of a run on its items; pytest-rerunfailures clears the same.
    item._report_sections.clear()
    if getattr(item, "cls", None) is not None:
        for name in ("_instance", "_obj"):
            item.__dict__.pop(name, None)
    return runtestprotocol(item, log=False, nextitem=sibling)


def _log_failure(
    item: pytest.Item, reports: list[pytest.TestReport], repetition: Repetition, number: str, *, last: int
) -> None:
    nodeid = f"{item.nodeid}[{repetition}]"
    file, line, name = item.location
    where = f"{repetition.action}:{repetition.direction}:{repetition.index}"
    told = f"{number}: {repetition.fault}\nonly this one: pytest '{item.nodeid}' --each-packet {where}"
    if last == MOST_FAILURES:
        told += f"\n{MOST_FAILURES} repetitions failed; the others were not tried"
    item.ihook.pytest_runtest_logstart(nodeid=nodeid, location=item.location)
    for report in reports:
        report.location = (file, line, f"{name}[{repetition}]")
        setattr(report, OWN_ID, nodeid)
        if report.failed:
            report.sections.insert(0, (f"each_packet {report.when}", told))
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=nodeid, location=item.location)


def _nothing_to_hit(
    item: pytest.Item, reports: list[pytest.TestReport], packets: Mapping[Direction, int]
) -> pytest.TestReport:
    report = reports[1]
    passed = ", ".join(f"{count} {direction}" for direction, count in packets.items())
    report.outcome = "failed"
    report.longrepr = f"{item.nodeid}: each_packet has no packet to hit; packets of the undisturbed run: {passed}"
    return report


def _sweeps(mark: pytest.Mark) -> Iterator[Sweep]:
    if not mark.args:
        raise UsageError(f"each_packet needs an action, for example each_packet('drop'); valid: {_valid(PacketAction)}")
    for name in mark.kwargs:
        if name not in _ARGUMENTS:
            raise UnknownName("argument of each_packet", name, _ARGUMENTS)
    direction, every = mark.kwargs.get("direction"), mark.kwargs.get("every", 1)
    only, delay_ms = mark.kwargs.get("only"), mark.kwargs.get("delay_ms", DEFAULT_DELAY_MS)
    if direction is not None and direction not in set(Direction):
        raise UnknownName("direction", str(direction), Direction)
    if not isinstance(every, int) or every < 1:
        raise ConfigurationError(f"every={every!r} of each_packet; a whole number from 1 on is needed")
    if not (only is None or isinstance(only, range)):
        raise ConfigurationError(f"only={only!r} of each_packet; a range of packet numbers is needed: range(10, 20)")
    directions = tuple(Direction) if direction is None else (Direction(direction),)
    for action in mark.args:
        if action not in set(PacketAction):
            raise UnknownName("action of each_packet", str(action), PacketAction)
        sweep = Sweep(PacketAction(action), directions, every, only, delay_ms)
        # Refused here if the delay cannot be.
        assert Repetition(sweep.action, directions[0], 0, delay_ms).fault  # noqa: S101
        yield sweep


def _valid(names: type[PacketAction]) -> str:
    return ", ".join(names)


def _bad_choice(text: str) -> UsageError:
    return UsageError(
        f"--each-packet {text}: a packet number is needed, if need be behind an action ({', '.join(PacketAction)}) and "
        f"a direction ({', '.join(Direction)}): drop:to-controller:17; or none"
    )
