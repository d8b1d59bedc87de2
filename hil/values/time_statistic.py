"""How time statistics are written (manual 7.9.1, 11.1)."""


def time_statistic(*, count: int, min_ms: float, mean_ms: float, max_ms: float, standard_deviation_ms: float) -> str:
    """Return them in the manual's format: ``n(20687) T(0.91, 1.92, 6.36 msec) (stdDev 0.36)``."""
    if not count:
        return "n(0) T(-, -, - msec) (stdDev -)"
    return f"n({count}) T({min_ms:.2f}, {mean_ms:.2f}, {max_ms:.2f} msec) (stdDev {standard_deviation_ms:.2f})"
