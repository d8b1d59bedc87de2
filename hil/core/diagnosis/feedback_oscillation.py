"""The feedback effect (manual 7.11): destinations and measured positions that swing each other up.

A loop with the gain ``k`` and nothing but dead time, G(z) = 1 / (1 + k z^-n), swings with a period of twice its dead
time, and each swing is ``k`` times the one before. So growth of one half period is the gain of such a loop. Other loops
have another relation of the two; there the gain told is about right only near 1, and 1 is the border all the same.

What is looked at are the turns (peaks and valleys) of the destinations of each axis and of its measured position.

- **Growing**: at least five swings of one period, about one mean, each larger than the one before and all by about the
  same factor, until they are three times as large as they were (five times, where little is known from before), and two
  and a half times as large as any swing in memory that took no longer than three of these; and the measured position
  lags behind by 10 to 270 degrees of the period. In a loop that has the arm in it the period is tied to the arm's
  delay, so the lag is never small; a program's own slow swing is followed within a few degrees.
- **Sustained**: twelve such swings of one size, with a lag of at least 30 degrees.

What it cannot tell apart: on a swing that neither grows nor decays, "the destination follows the measured position half
a period later" and "the measured position follows the destination" are the same numbers. So a sustained swing counts as
feedback only where it was seen to grow before; else both readings have to be told. A program that on purpose makes a
fast swing (above about half a hertz) grow by a constant factor looks like an unstable loop, and is called one; one that
adds to it by constant steps is not. Not seen are a loop whose dead time is more than about 17 times that of the arm,
swings below 0.2 mrad, a gain of less than about 1.05, and growth that is over in four swings or 0.1 s. A swing above
100 Hz has another frequency than is told.

Everything here is told times; what it keeps is bounded. Turns are looked for in batches, because most cycles have none.
"""

import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final, NamedTuple

from hil.core.diagnosis.turning_points import MOST_ROWS, Turn, TurningPoints
from hil.values.robot import JOINT_COUNT, Seven

SAMPLE_NS: Final = 3_000_000
"""Destinations that come sooner after one another are not all looked at."""
BATCH_NS: Final = 100_000_000
FORGET_AFTER_NS: Final = 2_000_000_000
"""After so long without a destination nothing before it counts."""
LOOK_EVERY_NS: Final = 50_000_000
LOOK_FOR_SUSTAINED_EVERY_NS: Final = 500_000_000
_GROWING_SWINGS: Final = 5
_MOST_SWINGS: Final = 24
_GROWN: Final = 3.0
_GROWN_AT_FIRST: Final = 5.0
"""The same where fewer than so many swings before are known: noise builds up when a motion begins."""
_ENOUGH_KNOWN: Final = 16
_STEADY_RATE: Final = 0.75
"""Growth of the later half of the swings over that of the earlier, at least: a linear ramp has 0.58 when it trebles."""
_SCATTER: Final = 0.12
"""Root mean square of the logarithms of the swings about their line."""
_RECORD: Final = 2.5
"""How much larger than any before a swing has to be: noise at a gain just below 1 waxes and wanes."""
_GROWING_LAG_DEG: Final = (10.0, 270.0)
_SUSTAINED_LAG_DEG: Final = (30.0, 270.0)
_SUSTAINED_SWINGS: Final = 12
_SUSTAINED_SPREAD: Final = 1.15
_SUSTAINED_MIN_RAD: Final = 1e-3
_SUSTAINED_GROWTH: Final = 0.03
_THRICE: Final = 12
"""Swings that must have repeated with one factor three swings later, where each half period has three turns."""
_UNLIKE: Final = 0.9
"""One of the three is at least so much smaller than the one before."""
_SAME_PERIOD: Final = 0.35
_MEAN_STAYS: Final = 0.5


class Oscillation(NamedTuple):
    """What one axis does."""

    axis: int
    """From 0."""
    at_ns: int
    growing: bool
    grown: bool
    """Whether it was seen to grow."""
    frequency_hz: float
    amplitude_rad: float
    """Of the destinations, from their mean."""
    growth: float
    """Factor from one period to the next."""
    lag_deg: float
    """How far the measured position is behind the destinations, in degrees of the period."""
    half_periods: int
    """What it was read from."""

    @property
    def gain(self) -> float:
        """Gain of the loop, if what is in it is gain and dead time: growth of half a period."""
        return math.sqrt(self.growth)

    @property
    def half_period_ms(self) -> float:
        """Half a period: the whole delay of such a loop."""
        return 500.0 / self.frequency_hz


@dataclass(slots=True)
class _Axis:
    destination: TurningPoints = field(default_factory=TurningPoints)
    measured: TurningPoints = field(default_factory=TurningPoints)
    stood: float = math.nan
    """The last destination."""
    looked_ns: int = -LOOK_EVERY_NS
    looked_for_sustained_ns: int = 0
    grown_half_ns: float = 0.0
    """Half period of the swing that was seen to grow."""


class FeedbackOscillation:
    """Takes each destination with what was measured when it arrived, and says which axes swing."""

    def __init__(self) -> None:
        self._axes = [_Axis() for _ in range(JOINT_COUNT)]
        self._batch: list[tuple[int, Seven, Seven]] = []
        self._last_ns = -SAMPLE_NS

    def take(self, destination: Seven, measured: Seven, *, now_ns: int) -> tuple[Oscillation, ...]:
        """Take a destination, rad, and the positions measured when it arrived; return what was recognised with it."""
        since_ns = now_ns - self._last_ns
        if since_ns < SAMPLE_NS:
            return ()
        if since_ns > FORGET_AFTER_NS:
            self.forget()
        self._last_ns = now_ns
        batch = self._batch
        batch.append((now_ns, destination, measured))
        if len(batch) < MOST_ROWS and now_ns - batch[0][0] < BATCH_NS:
            return ()
        return self._look(now_ns)

    def forget(self) -> None:
        """Another motion begins."""
        self._axes = [_Axis() for _ in range(JOINT_COUNT)]
        self._batch = []

    def _look(self, now_ns: int) -> tuple[Oscillation, ...]:
        times_ns, destinations, measured = zip(*self._batch, strict=True)
        self._batch = []
        first, middle, last = destinations[0], destinations[len(destinations) // 2], destinations[-1]
        found: list[Oscillation] = []
        for number, axis in enumerate(self._axes):
            stands = axis.stood == first[number] == middle[number] == last[number]
            turned = False
            if not stands:
                axis.stood = last[number]
                turned = axis.destination.take(times_ns, destinations, number)
            if not axis.destination.turns:
                continue
            axis.measured.take(times_ns, measured, number)
            if turned and now_ns - axis.looked_ns >= LOOK_EVERY_NS:
                axis.looked_ns = now_ns
                seen = _judge(number, axis, now_ns)
                if seen is not None:
                    found.append(seen)
        return tuple(found)


def _judge(number: int, axis: _Axis, now_ns: int) -> Oscillation | None:
    points = axis.destination
    turns = _growing(points.turns, points.swings)
    growing = turns is not None
    if turns is None and now_ns - axis.looked_for_sustained_ns >= LOOK_FOR_SUSTAINED_EVERY_NS:
        axis.looked_for_sustained_ns = now_ns
        turns = _sustained(points.turns, points.swings)
    if turns is None or not _mean_stays(turns):
        return None
    swings = _swings(turns)
    half_ns = (turns[-1].at_ns - turns[0].at_ns) / len(swings)
    lag_deg = _lag_deg(turns, axis.measured.turns, 2.0 * half_ns)
    least, most = _GROWING_LAG_DEG if growing else _SUSTAINED_LAG_DEG
    if lag_deg is None or not least <= lag_deg <= most:
        return None
    if growing:
        axis.grown_half_ns = half_ns
    return Oscillation(
        axis=number,
        at_ns=now_ns,
        growing=growing,
        grown=abs(half_ns - axis.grown_half_ns) <= _SAME_PERIOD * half_ns,
        frequency_hz=0.5e9 / half_ns,
        amplitude_rad=swings[-1] / 2,
        growth=math.exp(2.0 * _slope(swings)),
        lag_deg=lag_deg,
        half_periods=len(swings),
    )


def _growing(turns: deque[Turn], swings: deque[float]) -> Sequence[Turn] | None:
    """Return the last turns as far as they grow, each half period or (dead time alone) with its third harmonic."""
    if len(swings) < _GROWING_SWINGS:
        return None
    if swings[-5] <= swings[-4] <= swings[-3] <= swings[-2] <= swings[-1]:
        return _grown(tuple(turns), tuple(swings))
    if not _turns_thrice(swings):
        return None
    kept = tuple(turns)
    every_third = [kept[len(kept) - 1 - back :: -3][::-1] for back in range(3)]
    largest = max(every_third, key=lambda part: abs(part[-1].value - part[-2].value))
    return _grown(largest, _swings(largest))


def _turns_thrice(swings: deque[float]) -> bool:
    """Return whether each half period has three turns, and all swings repeat with one factor in the next.

    Dead time alone lets the third harmonic through like the wave itself, so a loop of it keeps the shape it began with.
    """
    if len(swings) < _THRICE + 3 or swings[-1] <= swings[-4] or swings[-4] <= swings[-7]:
        return False
    last = tuple(swings)[-_THRICE - 3 :]
    if all(last[place + 1] > _UNLIKE * last[place] for place in (-4, -3, -2)):
        return False
    factors = [math.log(there / here) for here, there in zip(last, last[3:], strict=False)]
    middle = sum(factors) / len(factors)
    return max(abs(factor - middle) for factor in factors) <= 2 * _SCATTER


def _swings(turns: Sequence[Turn]) -> list[float]:
    return [abs(there.value - here.value) for here, there in pairwise(turns)]


def _coherent(turns: Sequence[Turn], least: int) -> int:
    """Return how many of the last half periods are about as long as each other; ``least`` turns make their length."""
    usual = sorted(turns[-place].at_ns - turns[-place - 1].at_ns for place in range(1, least))[(least - 1) // 2]
    run = 0
    while run < len(turns) - 1:
        half = turns[-run - 1].at_ns - turns[-run - 2].at_ns
        if abs(half - usual) > _SAME_PERIOD * usual:
            break
        run += 1
    return run


def _grown(turns: Sequence[Turn], swings: Sequence[float]) -> Sequence[Turn] | None:
    """Return the last turns, where their swings grew to a multiple of their size by a constant factor."""
    if len(swings) < _GROWING_SWINGS:
        return None
    run, newest = _coherent(turns, _GROWING_SWINGS + 1), swings[-1]
    for window in range(_GROWING_SWINGS, min(run, _MOST_SWINGS) + 1):
        if swings[-window] > swings[1 - window]:
            return None
        if newest < _GROWN * swings[-window] or not _by_one_factor(swings[-window:]):
            continue
        longest_ns = 3 * (turns[-1].at_ns - turns[-2].at_ns)
        before = zip(swings[:-window], turns, turns[1:], strict=False)
        known = [swing for swing, here, there in before if there.at_ns - here.at_ns < longest_ns]
        if newest < _RECORD * max(known, default=0.0):
            return None
        if len(known) >= _ENOUGH_KNOWN or newest >= _GROWN_AT_FIRST * swings[-window]:
            return turns[-window - 1 :]
    return None


def _by_one_factor(swings: Sequence[float]) -> bool:
    logarithms = [math.log(swing) for swing in swings]
    last, middle = len(logarithms) - 1, (len(logarithms) - 1) // 2
    earlier = (logarithms[middle] - logarithms[0]) / middle
    later = (logarithms[last] - logarithms[middle]) / (last - middle)
    if later < _STEADY_RATE * earlier:
        return False
    slope, mean = _slope(swings), sum(logarithms) / len(logarithms)
    off = [value - mean - slope * (place - last / 2) for place, value in enumerate(logarithms)]
    return math.hypot(*off) <= _SCATTER * math.sqrt(len(off))


def _sustained(turns: deque[Turn], swings: deque[float]) -> Sequence[Turn] | None:
    """Return the last turns where all swings are about as large."""
    if len(swings) < _SUSTAINED_SWINGS:
        return None
    last = tuple(swings)[-_SUSTAINED_SWINGS:]
    least = min(last)
    if least < _SUSTAINED_MIN_RAD or max(last) > _SUSTAINED_SPREAD * least or abs(_slope(last)) > _SUSTAINED_GROWTH:
        return None
    part = tuple(turns)[-_SUSTAINED_SWINGS - 1 :]
    return part if _coherent(part, len(part)) == _SUSTAINED_SWINGS else None


def _slope(swings: Sequence[float]) -> float:
    """Return the mean logarithm of the factor from one swing to the next."""
    count = len(swings)
    centre = (count - 1) / 2
    spread = count * (count * count - 1) / 12
    return sum((place - centre) * math.log(swing) for place, swing in enumerate(swings)) / spread


def _mean_stays(turns: Sequence[Turn]) -> bool:
    first = (turns[0].value + turns[1].value) / 2
    last = (turns[-1].value + turns[-2].value) / 2
    return abs(last - first) <= _MEAN_STAYS * abs(turns[-1].value - turns[-2].value)


def _lag_deg(destination: Sequence[Turn], measured: Iterable[Turn], period_ns: float) -> float | None:
    """Return how far ``measured`` turns behind, -90..270 degrees; None where too few of its turns are known."""
    lags = []
    own = [turn for turn in measured if turn.at_ns >= destination[0].at_ns]
    for turn in destination:
        after = next((one.at_ns for one in own if one.peak is turn.peak and one.at_ns >= turn.at_ns), None)
        if after is not None and after - turn.at_ns <= 1.1 * period_ns:
            lags.append(360.0 * (after - turn.at_ns) / period_ns)
    if 2 * len(lags) < len(destination):
        return None
    middle = sorted(lags)[len(lags) // 2]
    return middle - 360.0 if middle > 270.0 else middle
