"""Distributions of times in little, bounded memory; the core's are finer, and not for applications."""

from bisect import bisect_left
from typing import Final

_NS_PER_MS: Final = 1_000_000
_EDGES_NS: Final = tuple(round(50_000 * 1.1**place) for place in range(150))
"""Upper edges of the buckets: 10 % apart, from 0.05 ms to 73 s; what is longer has a bucket of its own."""


class Spread:
    """Counts times; quantiles are good to 10 %, the longest is exact."""

    def __init__(self) -> None:
        self.count = 0
        self.longest_ns = 0
        self._counts = [0] * (len(_EDGES_NS) + 1)

    def add(self, time_ns: int) -> None:
        """Count one; a negative one counts as 0."""
        self.count += 1
        self._counts[bisect_left(_EDGES_NS, time_ns)] += 1
        if time_ns > self.longest_ns:  # noqa: PLR1730  # a call costs a tenth of all this
            self.longest_ns = time_ns

    def quantile_ms(self, fraction: float) -> float:
        """Return the upper edge of the bucket that has the quantile, at most the longest time; 0 before the first."""
        wanted, seen = max(1.0, self.count * fraction), 0
        for place, count in enumerate(self._counts):
            seen += count
            if seen >= wanted:
                edge_ns = _EDGES_NS[place] if place < len(_EDGES_NS) else self.longest_ns
                return min(edge_ns, self.longest_ns) / _NS_PER_MS
        return 0.0

    def report(self) -> dict[str, object]:
        """Return it for JSON, times in ms; ``histogram`` has [upper edge, count] of buckets that are not empty."""
        edges_ns = (*_EDGES_NS, self.longest_ns)
        return {
            "count": self.count,
            "p50": round(self.quantile_ms(0.5), 3),
            "p99": round(self.quantile_ms(0.99), 3),
            "max": round(self.longest_ns / _NS_PER_MS, 3),
            "histogram": [
                [round(edge_ns / _NS_PER_MS, 3), count]
                for edge_ns, count in zip(edges_ns, self._counts, strict=True)
                if count
            ],
        }
