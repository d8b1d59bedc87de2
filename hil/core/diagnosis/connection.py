"""Whose fault it was that FRI answers were late or missing, and the answer that lowered the quality.

The rule (ours). The latency budget runs from a message's departure to the kernel's stamp of its answer, so a cycle of
ours that begins late costs the client nothing by itself. But a message that leaves late comes with others, a stamp may
be taken before the machine stands still, and not every system stamps. So of a late answer this controller's own
lateness meanwhile is held against it: less than a quarter of the budget is no excuse, and the fault is the peer's or
the wire's; if without it at most half the budget would have been used, the fault is this controller's; in between it is
both. An answer that came in time and was read too late is this controller's. An answer that never came is this
controller's only if a whole budget of own lateness lies over it.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from hil.core.diagnosis.answer_path import AnswerPath
from hil.core.diagnosis.words import (
    GONE_REMEDIES,
    WATCHDOG_REMEDY,
    Sides,
    amount,
    median,
    milliseconds,
    remedies,
    signed,
)
from hil.core.fri.quality import WINDOW_NS, QualityMeter
from hil.core.statistics import Histogram
from hil.values.finding import Figure, Finding, Severity, Whose
from hil.values.fri import SEQUENCE_MODULUS, Quality

QUALITY_FELL: Final = "quality-fell"
CLIENT_LOST: Final = "client-lost"
QUALITY_NOT_REACHED: Final = "quality-not-reached"
MESSAGES_SKIPPED: Final = "messages-skipped"
_REMEMBERED: Final = 1024
"""Late and missing answers of the last second, at most one a millisecond."""
_WAITING: Final = 8
_ANSWER_WAIT_NS: Final = 100_000_000
"""A fall by a missing answer is told when that has come after all, or after this time."""
_MIXED_SHARE: Final = 0.9
_NEEDED: Final = {Quality.GOOD: 99, Quality.FAIR: 95, Quality.POOR: 75}
"""Answers in time of 100, for the level above."""


@dataclass(slots=True)
class _Bad:
    """An answer that did not come within its budget, or was not read then."""

    counter: int
    departed_ns: int
    judged_ns: int
    send_lateness_ns: int
    own_ns: int
    """The largest own lateness from the message's due time to the judgement."""
    whose: Whose
    age_ns: int | None = None
    """How long it took after all; None while it is missing."""
    overtaken: bool = False
    """It came in time, but behind the answer to a later message."""
    unread: bool = False
    """It came in time, and was read too late."""


@dataclass(slots=True)
class _Fall:
    """A fall of the quality that is told as soon as it is known what became of the answer."""

    old: Quality
    new: Quality
    cycle: int
    at_ns: int
    bad: _Bad
    commanding: bool
    counts: str
    tell_at_ns: int = 0
    """Where the answer may still come: when it is told without it."""


class ConnectionDiagnosis:
    """Of one FRI link; told what is not as it should be, so it costs nothing while all is well."""

    def __init__(
        self,
        *,
        send_period_ms: int,
        receive_multiplier: int,
        path: AnswerPath,
        meter: QualityMeter,
        add: Callable[[Finding, str, int], None],
        sides: Sides | None = None,
    ) -> None:
        """``add`` takes a finding, its subject and the time."""
        self._period_ms = send_period_ms
        self._multiplier = receive_multiplier
        self._budget_ns = send_period_ms * receive_multiplier * 1_000_000
        self._path = path
        self._meter = meter
        self._add = add
        self._sides = sides or Sides()
        self._bad: deque[_Bad] = deque(maxlen=_REMEMBERED)
        self._came_late: deque[tuple[int, int, bool]] = deque(maxlen=16)
        """Answers that do not count, whose window is not over yet: message, age, whether it was overtaken."""
        self._falls: deque[_Fall] = deque(maxlen=_WAITING)
        self.tell_at_ns: int | None = None
        """When :meth:`tell` has something to say; None while nothing waits."""
        self.late = dict.fromkeys((Whose.CONTROLLER, Whose.PEER_OR_WIRE, Whose.BOTH), 0)
        self.missing = dict.fromkeys((Whose.CONTROLLER, Whose.PEER_OR_WIRE, Whose.BOTH), 0)

    def missed(self, counter: int, departed_ns: int, now_ns: int) -> None:
        """No answer came in time to the messages from ``counter`` on, the last of which left at ``departed_ns``."""
        if not self._meter.ever_answered:
            return  # the client was not started yet
        due_ns = self._path.due_ns((counter + self._multiplier - 1) % SEQUENCE_MODULUS)
        lateness_ns = 0 if due_ns is None else departed_ns - due_ns
        own_ns = max(lateness_ns, self._path.lateness_between(departed_ns, now_ns))
        bad = _Bad(counter, departed_ns, now_ns, lateness_ns, own_ns, self._whose(own_ns, None))
        self._bad.append(bad)
        self.missing[bad.whose] += 1
        for reflected, age_ns, overtaken in self._came_late:
            if self._is_of(bad, reflected):
                self._came_after_all(bad, age_ns, overtaken=overtaken)
                break

    def uncounted(self, reflected: int, *, age_ns: int, now_ns: int, overtaken: bool = False) -> None:
        """An answer came that the quality does not count: too late, read too late, overtaken, or not needed."""
        for bad in reversed(self._bad):
            if now_ns - bad.judged_ns > WINDOW_NS:
                break
            if bad.age_ns is None and self._is_of(bad, reflected):
                self._came_after_all(bad, age_ns, overtaken=overtaken)
                return
        if overtaken or age_ns > self._budget_ns:
            self._came_late.append((reflected, age_ns, overtaken))

    def fell(self, old: Quality, new: Quality, *, now_ns: int, commanding: bool) -> None:
        """The quality fell."""
        cycle, fell_at_ns = self._path.cycle, self._meter.fell_at_ns
        bad = self._last(now_ns)
        if bad is None or bad.judged_ns != fell_at_ns:
            slow = [one for one in self._path.used if one[0] == fell_at_ns and 2 * one[1] >= self._budget_ns]
            if slow and new is Quality.GOOD and self._meter.answered_count * 100 >= 99 * self._meter.expected_count:
                self._tell_slow(old, new, slow[0], cycle, now_ns)
                return
        if bad is None:
            return
        self._tell_or_wait(_Fall(old, new, cycle, now_ns, bad, commanding, self._counts(now_ns)))

    def recorded_fall(self, old: Quality, new: Quality, message: int, *, now_ns: int, commanding: bool) -> None:
        """The controller told in ``message`` that the quality fell; by what rule it judged is not known."""
        bad = self._last(now_ns)
        if bad is not None:
            self._tell_or_wait(_Fall(old, new, message, now_ns, bad, commanding, self._counts(now_ns)))
            return
        self._add(
            Finding(
                QUALITY_FELL,
                Severity.FAULT if commanding and new < Quality.GOOD else Severity.WARNING,
                Whose.PEER_OR_WIRE if self._sides.other_whose is Whose.PEER_OR_WIRE else Whose.WIRE,
                f"{self._drop(old, new, message)}, though every answer of the second "
                f"before passed the place of the capture in time: the wire between there and {self._sides.controller}, "
                f"or {self._sides.controller} itself",
                figures={"message": message, "at_s": now_ns / 1e9},
            ),
            new.name,
            now_ns,
        )

    def lost(
        self, *, in_a_row: int, silent_ns: int, watchdog_ns: int, heard: tuple[int, int] | None, now_ns: int
    ) -> None:
        """The watchdog ended the overlay; ``heard`` is the message answered last, and when that came."""
        since_ns = now_ns - silent_ns if heard is None else heard[1]
        own_ns = max(
            [
                self._path.lateness_between(since_ns, now_ns),
                *(one.own_ns for one in self._bad if one.judged_ns >= since_ns),
            ]
        )
        whose = self._sides.other_whose
        if own_ns >= silent_ns / 2:
            whose = Whose.CONTROLLER
        elif own_ns >= self._budget_ns:
            whose = Whose.BOTH
        last = (
            ""
            if heard is None
            else f"the last answer was to message {heard[0]}, {milliseconds(now_ns - heard[1])} before; "
        )
        own = f"its messages since left and its cycles began at most {amount(own_ns)} late"
        self._add(
            Finding(
                CLIENT_LOST,
                Severity.FAULT,
                whose,
                f"client lost at cycle {self._path.cycle}: {in_a_row} answers in a row are missing, "
                f"{milliseconds(silent_ns)} of silence where the watchdog allows {milliseconds(watchdog_ns)}; {last}"
                f"{self._verdict(whose)}: {own}",
                remedies=(*GONE_REMEDIES, WATCHDOG_REMEDY)
                if whose is self._sides.other_whose
                else remedies(whose, self._sides, self._path.peer_and_wire, self._budget_ns),
                figures={
                    "cycle": self._path.cycle,
                    "missing_in_a_row": in_a_row,
                    "silent_ms": silent_ns / 1e6,
                    "watchdog_ms": watchdog_ns / 1e6,
                    "last_answered_message": None if heard is None else heard[0],
                    "own_lateness_ms": own_ns / 1e6,
                },
            ),
            "",
            now_ns,
        )

    def not_reached(self, *, now_ns: int) -> None:
        """The quality is not GOOD, though there was time enough for it."""
        meter, latency = self._meter, self._path.peer_and_wire
        counts = {whose: self.late[whose] + self.missing[whose] for whose in self.late}
        bad = sum(counts.values())
        if not bad:
            return
        whose = max(counts, key=lambda one: counts[one])
        if counts[whose] < _MIXED_SHARE * bad:
            whose = Whose.BOTH
        shares = ", ".join(f"{count} {self._name(one)}" for one, count in counts.items() if count)
        self._add(
            Finding(
                QUALITY_NOT_REACHED,
                Severity.WARNING,
                self._outward(whose),
                f"quality {meter.quality.name}, GOOD is needed for a motion: {meter.describe()}; "
                f"{self._verdict(whose)}",
                evidence=(
                    f"late or missing since the beginning: {bad} ({shares})",
                    *(f"the last of them: {self._story(one, latency)}" for one in list(self._bad)[-1:]),
                ),
                remedies=remedies(whose, self._sides, latency, self._budget_ns),
                figures={
                    "late_or_missing": bad,
                    "of_the_controller": counts[Whose.CONTROLLER],
                    "of_peer_or_wire": counts[Whose.PEER_OR_WIRE],
                    "of_both": counts[Whose.BOTH],
                },
            ),
            "",
            now_ns,
        )

    def skipped(self, messages: int, missed_ns: int, *, now_ns: int) -> None:
        """No cycle ran for ``missed_ns``, in which ``messages`` would have been sent."""
        sides, cycle = self._sides, self._path.cycle
        count = f"{messages} messages were" if messages > 1 else "1 message was"
        self._add(
            Finding(
                MESSAGES_SKIPPED,
                Severity.NOTE,
                Whose.CONTROLLER,
                f"{count} not sent: no cycle ran for {milliseconds(missed_ns)} before cycle {cycle}; "
                f"{sides.controller} was held up, and the peer is not to blame for what it did not get",
                remedies=(sides.controller_remedy,),
                figures={"messages": messages, "cycle": cycle, "missed_ms": missed_ns / 1e6},
            ),
            "",
            now_ns,
        )

    def tell(self, now_ns: int, *, over: bool = False) -> None:
        """Tell the falls whose missing answer has come, or has had its time; ``over``: whatever waits."""
        for fall in list(self._falls):
            if over or fall.bad.age_ns is not None or now_ns >= fall.tell_at_ns:
                self._falls.remove(fall)
                self._tell_fall(fall, now_ns)
        self.tell_at_ns = min((fall.tell_at_ns for fall in self._falls), default=None)

    def report(self) -> dict[str, object]:
        """Return late and missing answers by whose fault, for the status file."""
        names = {Whose.CONTROLLER: "controller", Whose.PEER_OR_WIRE: "peer_or_wire", Whose.BOTH: "both"}
        return {
            "late": {names[whose]: count for whose, count in self.late.items()},
            "missing": {names[whose]: count for whose, count in self.missing.items()},
            "messages_skipped": self._path.skipped,
        }

    def _tell_or_wait(self, fall: _Fall) -> None:
        if fall.bad.age_ns is None:
            fall.tell_at_ns = fall.at_ns + max(_ANSWER_WAIT_NS, 4 * self._budget_ns)
            self._falls.append(fall)
            self.tell_at_ns = min(one.tell_at_ns for one in self._falls)
        else:
            self._tell_fall(fall, fall.at_ns)

    def _is_of(self, bad: _Bad, reflected: int) -> bool:
        return (reflected - bad.counter) % SEQUENCE_MODULUS < self._multiplier

    def _came_after_all(self, bad: _Bad, age_ns: int, *, overtaken: bool) -> None:
        self.missing[bad.whose] -= 1
        bad.age_ns = age_ns
        if age_ns > self._budget_ns:
            bad.whose = self._whose(bad.own_ns, age_ns)
        elif overtaken:
            bad.whose, bad.overtaken = Whose.PEER_OR_WIRE, True
        else:
            bad.whose, bad.unread = Whose.CONTROLLER, True
        self.late[bad.whose] += 1
        if self._falls:
            self.tell_at_ns = bad.judged_ns

    def _whose(self, own_ns: int, age_ns: int | None) -> Whose:
        if age_ns is None:
            return Whose.CONTROLLER if own_ns >= self._budget_ns else Whose.PEER_OR_WIRE
        if 4 * own_ns < self._budget_ns:
            return Whose.PEER_OR_WIRE
        return Whose.CONTROLLER if 2 * (age_ns - own_ns) <= self._budget_ns else Whose.BOTH

    def _last(self, now_ns: int) -> _Bad | None:
        """Return the last one, if it is of the last second."""
        return self._bad[-1] if self._bad and now_ns - self._bad[-1].judged_ns <= WINDOW_NS else None

    def _recent_faults(self, now_ns: int) -> list[Whose]:
        """Return whose fault each one of the last second was."""
        return [one.whose for one in self._bad if now_ns - one.judged_ns <= WINDOW_NS]

    def _whose_in_window(self, tipping: Whose, now_ns: int) -> Whose:
        """Return whose fault it was where others made it possible that one answer tipped it."""
        recent = self._recent_faults(now_ns)
        if recent.count(tipping) >= _MIXED_SHARE * len(recent):
            return tipping
        return Whose.BOTH

    def _counts(self, now_ns: int) -> str:
        meter = self._meter
        recent = self._recent_faults(now_ns)
        bad = meter.expected_count - meter.answered_count
        text = f"{bad} of the {meter.expected_count} answers of the last second were late or missing"
        shares = [f"{recent.count(whose)} {self._name(whose)}" for whose in self.late if whose in recent]
        return f"{text}: {', '.join(shares)}" if shares else text

    def _name(self, whose: Whose) -> str:
        return {Whose.CONTROLLER: self._sides.controller, Whose.BOTH: "both"}.get(whose, self._sides.other)

    def _drop(self, old: Quality, new: Quality, place: int) -> str:
        return f"quality {old.name} -> {new.name} at {self._sides.moment} {place}"

    def _verdict(self, whose: Whose) -> str:
        sides = self._sides
        if whose is Whose.CONTROLLER:
            return f"{sides.controller}, not peer or wire"
        if whose is Whose.BOTH:
            return f"both {sides.controller} and {sides.other}"
        return f"{sides.other}, not {sides.controller}"

    def _tell_fall(self, fall: _Fall, now_ns: int) -> None:
        bad, latency = fall.bad, self._path.peer_and_wire
        whose = self._whose_in_window(bad.whose, fall.at_ns)
        gone = bad.age_ns is None and whose is Whose.PEER_OR_WIRE
        ended = ", which ends the overlay" if fall.commanding and fall.new < Quality.GOOD else ""
        self._add(
            Finding(
                QUALITY_FELL,
                Severity.NOTE if fall.new is Quality.GOOD else Severity.FAULT if fall.commanding else Severity.WARNING,
                self._outward(whose),
                f"{self._drop(fall.old, fall.new, fall.cycle)}{ended}: {self._story(bad, latency)}; "
                f"{self._verdict(whose)}",
                evidence=(
                    f"{fall.counts}; {Quality(fall.new + 1).name} needs {_NEEDED[fall.new]} % in time",
                    *self._split(bad),
                ),
                remedies=GONE_REMEDIES if gone else remedies(whose, self._sides, latency, self._budget_ns),
                figures=self._figures(fall),
            ),
            fall.new.name,
            now_ns,
        )

    def _outward(self, whose: Whose) -> Whose:
        return self._sides.other_whose if whose is Whose.PEER_OR_WIRE else whose

    def _tell_slow(self, old: Quality, new: Quality, slow: tuple[int, int, int], cycle: int, now_ns: int) -> None:
        received_ns, age_ns, counter = slow
        latency = self._path.peer_and_wire
        departed_ns = received_ns - age_ns
        due_ns = self._path.due_ns(counter)
        lateness_ns = 0 if due_ns is None else departed_ns - due_ns
        own_ns = max(lateness_ns, self._path.lateness_between(departed_ns, received_ns))
        whose = self._whose(own_ns, age_ns)
        meter, left = self._meter, self._left(lateness_ns, own_ns)
        half = f"in time, but half of the {milliseconds(self._budget_ns)} allowed or more {median(latency)}"
        often = f"as {meter.slow_count} of {meter.answered_count} did in the last second where {old.name} allows 5 %"
        self._add(
            Finding(
                QUALITY_FELL,
                Severity.NOTE,
                self._outward(whose),
                f"{self._drop(old, new, cycle)}: message {counter} {left}, its answer took "
                f"{milliseconds(age_ns)}, {half}, {often}; {self._verdict(whose)}",
                remedies=remedies(whose, self._sides, latency, self._budget_ns),
                figures={
                    "cycle": cycle,
                    "message": counter,
                    "latency_ms": age_ns / 1e6,
                    "budget_ms": self._budget_ns / 1e6,
                    "send_lateness_us": lateness_ns / 1e3,
                    "own_lateness_us": own_ns / 1e3,
                },
            ),
            new.name,
            now_ns,
        )

    def _story(self, bad: _Bad, latency: Histogram) -> str:
        left = self._left(bad.send_lateness_ns, bad.own_ns)
        allowed = milliseconds(self._budget_ns)
        if self._multiplier > 1:
            last = (bad.counter + self._multiplier - 1) % SEQUENCE_MODULUS
            who = f"messages {bad.counter} to {last} {left}"
        else:
            who = f"message {bad.counter} {left}"
        if bad.age_ns is None:
            return f"{who}, no answer to {'them' if self._multiplier > 1 else 'it'} came {median(latency, allowed)}"
        took = milliseconds(bad.age_ns)
        if bad.unread:
            return f"{who}, its answer came in time, after {took}, and was read after the {allowed} allowed"
        if bad.overtaken:
            return f"{who}, its answer came after {took}, but behind the answer to a later message"
        return f"{who}, its answer took {took} of the {allowed} allowed {median(latency)}"

    def _left(self, lateness_ns: int, own_ns: int) -> str:
        late = 4 * lateness_ns >= self._budget_ns
        text = f"left {amount(lateness_ns)} late" if late else f"left on time ({signed(lateness_ns)})"
        if own_ns > lateness_ns and 4 * own_ns >= self._budget_ns:
            text += f" and a cycle behind it began {amount(own_ns)} late"
        return text

    def _split(self, bad: _Bad) -> tuple[str, ...]:
        lines = [f"send: {signed(bad.send_lateness_ns)} after the message was due"]
        if bad.age_ns is not None:
            over = bad.age_ns - self._budget_ns
            more = f", {milliseconds(over)} over the budget" if over > 0 else ""
            lines.append(
                f"peer and wire: {milliseconds(bad.age_ns)} from there to its answer{more} "
                f"(send period {self._period_ms} ms x receive multiplier {self._multiplier})"
            )
        lines.append(
            f"lateness of {self._sides.controller} meanwhile, sending or in its cycles: at most {amount(bad.own_ns)}"
        )
        skip_ns = self._path.last_skip_ns
        if skip_ns is not None and 0 <= bad.judged_ns - skip_ns <= WINDOW_NS:
            lines.append(f"messages were skipped in the second before, {self._path.skipped} in all so far")
        return tuple(lines)

    def _figures(self, fall: _Fall) -> dict[str, Figure]:
        bad = fall.bad
        return {
            "cycle": fall.cycle,
            "at_s": fall.at_ns / 1e9,
            "message": bad.counter,
            "latency_ms": None if bad.age_ns is None else bad.age_ns / 1e6,
            "budget_ms": self._budget_ns / 1e6,
            "over_ms": None if bad.age_ns is None else (bad.age_ns - self._budget_ns) / 1e6,
            "send_lateness_us": bad.send_lateness_ns / 1e3,
            "own_lateness_us": bad.own_ns / 1e3,
        }
